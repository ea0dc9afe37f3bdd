"""§2.1–2.2 The benchmark: curves, surfaces, poses, perturbations, and how they lie on disk. NumPy only."""
