"""§3.2 M2, Multi-Head Symmetry Transformer: a pre-trained encoder, 27 heads of one plane each, and a cleaning step."""
