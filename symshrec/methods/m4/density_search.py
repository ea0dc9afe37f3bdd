"""M4 steps 2 and 3 on an even sample of a whole object: candidates that climb the log-likelihood, coarse to fine."""

import torch
from torch import Tensor

from symshrec.methods.fit.coupling import closure, distinct, find_relations, orbit_means
from symshrec.methods.fit.density import Density, densities
from symshrec.methods.fit.likelihood import RELATION_DEG, RELATION_DISTANCE, ascended, divergence
from symshrec.methods.m4.search import searched
from symshrec.methods.m4.settings import M4Settings

# Lengths are shares of the cloud's size (see `frame_of`), divergences in nats a point.
COARSE_POINTS, COARSE_STEPS, COARSE_STEP = 200, 2, 0.12
MIDDLE_POINTS, MIDDLE_STEPS = 800, 4
FINE_POINTS, FINE_STEPS = 1500, 3
LONGEST_STEP = 0.05
HOPELESS = (0.6, 0.5, 0.3, 0.2, 0.12)  # divergences beyond which a candidate goes, stage by stage
LIKELY, TIED = 0.08, 0.025  # divergences above the best plane's up to which planes are completed, and tied together


class DensitySearch:
    """The cloud's densities at several bandwidths, and the candidate planes that climb through them, coarse to fine.

    Args:
        points: (N, 3) float32 in their frame, any prefix being a random sample.
    """

    def __init__(self, points: Tensor, settings: M4Settings):
        self.points, self.settings = points, settings
        self.densities = densities(points)

    def planes(self) -> tuple[Tensor, Tensor, Tensor]:
        """Normals (K, 3), offsets (K,) and divergences (K,) of what may be symmetries, the best first."""
        wide, search, coarse, middle, fine = self.densities
        few, some, more = (self.points[:count] for count in (COARSE_POINTS, MIDDLE_POINTS, FINE_POINTS))
        normals, offsets = searched(search, self.settings.directions, self.settings.candidates)
        for density in (wide, search, coarse):
            normals, offsets = ascended(density, few, normals, offsets, COARSE_STEPS, COARSE_STEP)
        normals, offsets, _ = self._kept(coarse, few, normals, offsets, HOPELESS[0])
        normals, offsets = ascended(middle, some, normals, offsets, MIDDLE_STEPS, LONGEST_STEP)
        normals, offsets, divergences = self._kept(middle, more, normals, offsets, HOPELESS[1])
        if self.settings.together:
            normals, offsets, divergences = self._completed(normals, offsets, divergences)
        for density, hopeless in zip((middle, fine), HOPELESS[3:], strict=True):
            tied = (divergences < divergences.min() + TIED) & self.settings.together
            normals, offsets = ascended(density, more, normals, offsets, FINE_STEPS, LONGEST_STEP, tied)
            normals, offsets, divergences = self._kept(density, more, normals, offsets, hopeless)
        divergences = divergence(fine, self.points, normals, offsets)
        if self.settings.together:
            relations = find_relations(normals, offsets, RELATION_DEG, RELATION_DISTANCE)
            tied = divergences < divergences.min() + TIED
            divergences = orbit_means(divergences, relations.mirrored_in(tied))
        order = torch.argsort(divergences, stable=True)
        return normals[order], offsets[order], divergences[order]

    def _kept(self, density: Density, points: Tensor, normals: Tensor, offsets: Tensor, hopeless: float):
        """Planes that differ and may be symmetries, at least one, with their divergences, the best first."""
        divergences = divergence(density, points, normals, offsets)
        kept = distinct(normals, divergences, self.settings.separation_deg)
        limit = hopeless + divergences.min().clamp_min(0)
        kept = kept[divergences[kept] <= limit][: self.settings.max_planes]
        return normals[kept], offsets[kept], divergences[kept]

    def _completed(self, normals: Tensor, offsets: Tensor, divergences: Tensor):
        """The planes and the images of the likely ones in each other that are not among them, with divergences."""
        _, _, coarse, middle, _ = self.densities
        some, more = self.points[:MIDDLE_POINTS], self.points[:FINE_POINTS]
        for _ in range(2):
            likely = divergences < divergences.min() + LIKELY
            images, places = closure(
                normals[likely], offsets[likely], self.settings.separation_deg, self.settings.max_planes
            )
            if not len(images):
                break
            for density in (coarse, middle):
                images, places = ascended(density, some, images, places, COARSE_STEPS, LONGEST_STEP)
            normals, offsets = torch.cat([normals, images]), torch.cat([offsets, places])
            normals, offsets, divergences = self._kept(middle, more, normals, offsets, HOPELESS[1])
        return self._kept(middle, more, normals, offsets, HOPELESS[2])
