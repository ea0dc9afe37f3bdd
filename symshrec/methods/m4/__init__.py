"""M4, our own, training-free: `pipeline` for one cloud, `module` for Lightning.

1. The cloud in a frame of its own, and its densities: `fit.frame`, `fit.density`.
2. Directions scored by the density at the mirrored points: `search`.
3. The best of them climb the log-likelihood: `fit.likelihood`, `density_search`.
4. Planes tied by their relations are aligned point to plane: `fit.coupling`, `fit.alignment`, `fit.ends`.
5. How sure each plane is: `confidence`.

Where no plane is sure by then, the cloud is no even sample of a whole symmetric object, and it goes on:

6. A floor is set aside, and the cloud made even: `fit.floor`, `fit.evening`.
7. Candidates also from pairs of points, at any offset: `votes`; they climb as before, and those go on that much surface
   supports: `fit.judgement`, `surface_search`, `fit.polishing`.
"""
