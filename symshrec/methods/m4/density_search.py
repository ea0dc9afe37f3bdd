"""M4 steps 2 and 3 on an even sample of a whole object: candidates that climb the log-likelihood, coarse to fine."""

import torch
from torch import Tensor

from symshrec.methods.fit.coupling import distinct, find_relations, orbit_means
from symshrec.methods.fit.density import Density, densities
from symshrec.methods.fit.likelihood import RELATION_DEG, RELATION_DISTANCE, ascended, divergence
from symshrec.methods.m4.climb import (
    COARSE_POINTS,
    FINE_POINTS,
    FINE_STEPS,
    LONGEST_STEP,
    MIDDLE_POINTS,
    MIDDLE_STEPS,
    Scored,
    climbed,
    completed,
)  # fmt: skip
from symshrec.methods.m4.search import searched
from symshrec.methods.m4.settings import M4Settings

# Divergences, in nats a point.
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

    def planes(self) -> tuple[Scored, Scored]:
        """Normals (K, 3), offsets (K,) and divergences (K,) of what may be symmetries, the best first.

        And the same of all that was left before the finest density.
        """
        _, search, coarse, middle, fine = self.densities
        few, some, more = (self.points[:count] for count in (COARSE_POINTS, MIDDLE_POINTS, FINE_POINTS))
        normals, offsets = searched(search, self.settings.directions, self.settings.candidates)
        normals, offsets = climbed(self.densities, self.points, normals, offsets)
        normals, offsets, _ = self._kept(coarse, few, normals, offsets, HOPELESS[0])
        normals, offsets = ascended(middle, some, normals, offsets, MIDDLE_STEPS, LONGEST_STEP)
        normals, offsets, divergences = self._kept(middle, more, normals, offsets, HOPELESS[1])
        if self.settings.together:
            normals, offsets, divergences = self._completed((normals, offsets, divergences))
        left = self._finer(middle, (normals, offsets, divergences), HOPELESS[3])
        normals, offsets, divergences = self._finer(fine, left, HOPELESS[4])
        divergences = divergence(fine, self.points, normals, offsets)
        if self.settings.together:
            relations = find_relations(normals, offsets, RELATION_DEG, RELATION_DISTANCE)
            tied = divergences < divergences.min() + TIED
            divergences = orbit_means(divergences, relations.mirrored_in(tied))
        order = torch.argsort(divergences, stable=True)
        return (normals[order], offsets[order], divergences[order]), left

    def _finer(self, density: Density, found: Scored, hopeless: float) -> Scored:
        """What is kept of the planes after an ascent through a fine density, those that fit as well tied together."""
        normals, offsets, divergences = found
        tied = (divergences < divergences.min() + TIED) & self.settings.together
        more = self.points[:FINE_POINTS]
        normals, offsets = ascended(density, more, normals, offsets, FINE_STEPS, LONGEST_STEP, tied)
        return self._kept(density, more, normals, offsets, hopeless)

    def _kept(self, density: Density, points: Tensor, normals: Tensor, offsets: Tensor, hopeless: float) -> Scored:
        """Planes that differ and may be symmetries, at least one, with their divergences, the best first."""
        divergences = divergence(density, points, normals, offsets)
        kept = distinct(normals, divergences, self.settings.separation_deg)
        limit = hopeless + divergences.min().clamp_min(0)
        kept = kept[divergences[kept] <= limit][: self.settings.max_planes]
        return normals[kept], offsets[kept], divergences[kept]

    def _completed(self, found: Scored) -> Scored:
        """The planes and the images of the likely ones in each other that are not among them, with divergences."""
        middle, more = self.densities[-2], self.points[:FINE_POINTS]

        def likely(divergences: Tensor) -> Tensor:
            return divergences < divergences.min() + LIKELY

        def kept(normals: Tensor, offsets: Tensor) -> Scored:
            return self._kept(middle, more, normals, offsets, HOPELESS[1])

        normals, offsets, _ = completed(found, likely, kept, self.densities, self.points, self.settings)
        return self._kept(middle, more, normals, offsets, HOPELESS[2])
