"""M4 steps 2 and 3 on what a scanner gives: uneven, incomplete. Candidates are judged by surface, not by density."""

import torch
from torch import Tensor

from symshrec.methods.fit.density import Density, densities
from symshrec.methods.fit.judgement import Judge
from symshrec.methods.fit.likelihood import FLOOR, ascended, divergence
from symshrec.methods.fit.steps import columns
from symshrec.methods.m4.climb import (
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
from symshrec.methods.m4.votes import best_apart, overlap, voted

# Values are those of `Judgement`, divergences in nats a point.
KEPT = 24  # planes after the coarse ascent
HOPELESS = 0.4  # of the best plane's value; planes below it go
SAME_OFFSET = 0.02  # planes with offsets nearer than this, and normals than separation_deg, are one
LIKELY, TIED = 0.12, 0.06  # of value, less than the best plane's: planes that are completed, and tied together
ALIKE = 0.025  # divergence above the best plane's, beyond which a plane is not tied to others
UNLIKELY, TELLING = 0.5, 0.1  # merit lost with a nat of divergence above the best plane's, and where that ends


class SurfaceSearch:
    """The evened cloud's densities at several bandwidths, and candidate planes that climb through them, coarse to fine.

    Args:
        judge: of planes, by the evened cloud.
    """

    def __init__(self, judge: Judge, settings: M4Settings):
        self.points, self.judge, self.settings = judge.even, judge, settings
        self.densities = densities(self.points)

    def planes(self, more_normals: Tensor, more_offsets: Tensor) -> Scored:
        """Normals (K, 3), offsets (K,) and merits (K,) of what may be symmetries, the best first.

        Args:
            more_normals, more_offsets: (J, 3), (J,), candidates known already.
        """
        _, search, coarse, middle, fine = self.densities
        some, more = (self.points[:count] for count in (MIDDLE_POINTS, FINE_POINTS))
        normals, offsets = self._candidates(search)
        normals, offsets = climbed(self.densities, self.points, normals, offsets)
        normals, offsets = torch.cat([normals, more_normals]), torch.cat([offsets, more_offsets])
        normals, offsets, _ = best_apart(normals, offsets, overlap(coarse, some, normals, offsets), KEPT)
        normals, offsets = ascended(middle, some, normals, offsets, MIDDLE_STEPS, LONGEST_STEP)
        normals, offsets, merit = self._judged(normals, offsets)
        if self.settings.together:
            normals, offsets, merit = self._completed((normals, offsets, merit))
        for density, points in ((middle, more), (fine, self.points)):
            tied = self.tied(normals, offsets, merit)
            normals, offsets = ascended(density, points, normals, offsets, FINE_STEPS, LONGEST_STEP, tied)
        merit = self.merit(normals, offsets)
        order = torch.argsort(merit, descending=True, stable=True)
        return normals[order], offsets[order], merit[order]

    def merit(self, normals: Tensor, offsets: Tensor) -> Tensor:
        """How planes (K, 3), (K,) are ranked: their value, less a little for what they lack of the best likelihood.

        Under noise the values of all planes are alike, and the likelihood tells; where parts are missing it misleads.
        """
        excess = self._divergences(normals, offsets)
        excess = (excess - excess.min()).clamp_max(TELLING)
        return self.judge(normals, offsets).value - UNLIKELY * excess

    def tied(self, normals: Tensor, offsets: Tensor, merit: Tensor) -> Tensor:
        """Which of the planes (K,) fit as well as the best one does, so that their relations hold."""
        divergences = self._divergences(normals, offsets)
        likely = merit > merit.max() - TIED
        return likely & (divergences < divergences[likely].min() + ALIKE) & self.settings.together

    def _divergences(self, normals: Tensor, offsets: Tensor) -> Tensor:
        return divergence(self.densities[-2], self.points[:FINE_POINTS], normals, offsets)

    def _candidates(self, density: Density) -> tuple[Tensor, Tensor]:
        """Planes through the centroid in which the cloud looks mirrored, and planes that pairs of points vote for."""
        settings = self.settings
        normals, offsets = searched(density, settings.directions, settings.candidates)
        others, places, _ = voted(self.points, density, self.judge.neighbours, settings.votes)
        return torch.cat([normals, others]), torch.cat([offsets, places])

    def _judged(self, normals: Tensor, offsets: Tensor) -> Scored:
        """Planes that differ and may be symmetries, at least one, with their merits, the best first."""
        merit = self.merit(normals, offsets)
        apart = self.settings.separation_deg, SAME_OFFSET
        normals, offsets, merit = best_apart(normals, offsets, merit, self.settings.max_planes, *apart)
        kept = merit >= HOPELESS * merit.max()
        return normals[kept], offsets[kept], merit[kept]

    def _completed(self, found: Scored) -> Scored:
        """The planes and the images of the likely ones in each other that are not among them, with merits."""

        def likely(merit: Tensor) -> Tensor:
            return merit > merit.max() - LIKELY

        return completed(found, likely, self._judged, self.densities, self.points, self.settings)


def repulsion(density: Density, cloud: Tensor, rows: Tensor) -> Tensor:
    """The divergence that a symmetry of an evened cloud has, from no point of it having another one near.

    Args:
        density: of the evened cloud, the `rows` (n,) of the cloud (N, 3). The other points stand for mirrored ones.
    """
    others = torch.ones(len(cloud), dtype=torch.bool, device=cloud.device)
    others[rows] = False
    others = cloud[others][:FINE_POINTS]
    if not len(others):
        return density.cells.new_zeros(())
    floor, points = FLOOR * density.mean, density.points[:FINE_POINTS]
    return (density.of_others(points) + floor).log().mean() - (density.at(columns(others)) + floor).log().mean()
