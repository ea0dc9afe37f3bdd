"""Figures, pages and TensorBoard."""
