"""M4 steps 2 and 3 on what a scanner gives: uneven, incomplete. Candidates are judged by surface, not by density."""

import torch
from torch import Tensor

from symshrec.methods.fit.coupling import closure
from symshrec.methods.fit.density import Density, densities
from symshrec.methods.fit.judgement import Judge
from symshrec.methods.fit.likelihood import FLOOR, ascended, divergence
from symshrec.methods.fit.surface import Neighbours
from symshrec.methods.m4.search import searched
from symshrec.methods.m4.settings import M4Settings
from symshrec.methods.m4.votes import best_apart, overlap, voted

# Lengths are shares of the cloud's size (see `frame_of`), values those of `Judgement`.
COARSE_POINTS, COARSE_STEPS, COARSE_STEP = 200, 2, 0.12
MIDDLE_POINTS, MIDDLE_STEPS = 800, 4
FINE_POINTS, FINE_STEPS = 1500, 3
LONGEST_STEP = 0.05
KEPT = 24  # planes after the coarse ascent
HOPELESS = 0.4  # of the best plane's value; planes below it go
SAME_OFFSET = 0.02  # planes with offsets nearer than this, and normals than separation_deg, are one
LIKELY, TIED = 0.12, 0.06  # of value, less than the best plane's: planes that are completed, and tied together
ALIKE = 0.025  # divergence above the best plane's, beyond which a plane is not tied to others
UNLIKELY, TELLING = 0.5, 0.1  # merit lost with a nat of divergence above the best plane's, and where that ends


class SurfaceSearch:
    """The evened cloud's densities at several bandwidths, and candidate planes that climb through them, coarse to fine.

    Args:
        points: (n, 3) float32, the evened cloud in its frame, any prefix being a random sample.
        neighbours: among them. judge: of planes.
    """

    def __init__(self, points: Tensor, neighbours: Neighbours, judge: Judge, settings: M4Settings):
        self.points, self.neighbours, self.judge, self.settings = points, neighbours, judge, settings
        self.densities = densities(points)

    def planes(self, more_normals: Tensor, more_offsets: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Normals (K, 3), offsets (K,) and values (K,) of what may be symmetries, the best first.

        Args:
            more_normals, more_offsets: (J, 3), (J,), candidates known already.
        """
        wide, search, coarse, middle, fine = self.densities
        few, some, more = (self.points[:count] for count in (COARSE_POINTS, MIDDLE_POINTS, FINE_POINTS))
        normals, offsets = self._candidates(search)
        for density in (wide, search, coarse):
            normals, offsets = ascended(density, few, normals, offsets, COARSE_STEPS, COARSE_STEP)
        normals, offsets = torch.cat([normals, more_normals]), torch.cat([offsets, more_offsets])
        normals, offsets, _ = best_apart(normals, offsets, overlap(coarse, some, normals, offsets), KEPT)
        normals, offsets = ascended(middle, some, normals, offsets, MIDDLE_STEPS, LONGEST_STEP)
        normals, offsets, merit = self._judged(normals, offsets)
        if self.settings.together:
            normals, offsets, merit = self._completed(normals, offsets, merit)
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
        others, places, _ = voted(self.points, density, self.neighbours, settings.votes)
        return torch.cat([normals, others]), torch.cat([offsets, places])

    def _judged(self, normals: Tensor, offsets: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Planes that differ and may be symmetries, at least one, with their merits, the best first."""
        merit = self.merit(normals, offsets)
        apart = self.settings.separation_deg, SAME_OFFSET
        normals, offsets, merit = best_apart(normals, offsets, merit, self.settings.max_planes, *apart)
        kept = merit >= HOPELESS * merit.max()
        return normals[kept], offsets[kept], merit[kept]

    def _completed(self, normals: Tensor, offsets: Tensor, merit: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """The planes and the images of the likely ones in each other that are not among them, with merits."""
        _, _, coarse, middle, _ = self.densities
        some = self.points[:MIDDLE_POINTS]
        for _ in range(2):
            likely = merit > merit.max() - LIKELY
            images, places = closure(
                normals[likely], offsets[likely], self.settings.separation_deg, self.settings.max_planes
            )
            if not len(images):
                break
            for density in (coarse, middle):
                images, places = ascended(density, some, images, places, COARSE_STEPS, LONGEST_STEP)
            normals, offsets, merit = self._judged(torch.cat([normals, images]), torch.cat([offsets, places]))
        return normals, offsets, merit


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
    return (density.of_others(points) + floor).log().mean() - (density.at(others) + floor).log().mean()
