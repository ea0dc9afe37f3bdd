"""Point-to-plane refinement of mirror planes, usable after any method, and step 4 of M4."""
