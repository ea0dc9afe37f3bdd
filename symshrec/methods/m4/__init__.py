"""M4, our own, training-free: `detection` for one cloud, `module` for Lightning.

1. The cloud in a frame of its own, and its densities: `refine.frame`, `refine.density`.
2. Directions scored by the density at the mirrored points: `search`.
3. The best of them climb the log-likelihood: `refine.likelihood`.
4. Planes tied by their relations are aligned point to plane: `refine.coupling`, `refine.alignment`, `refine.ends`.
5. How sure each plane is: `confidence`.
"""
