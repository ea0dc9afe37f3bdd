"""§3.3 M3, diffusion-based symmetry detection: `detection` on NumPy and SciPy alone, `module` for Lightning."""
