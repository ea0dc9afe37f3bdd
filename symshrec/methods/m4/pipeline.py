"""M4, our training-free detector: one cloud in, its mirror planes out."""

import torch
from torch import Tensor

from symshrec.methods.fit.alignment import AlignmentSettings, aligned
from symshrec.methods.fit.coupling import closure, distinct, find_relations, orbit_means
from symshrec.methods.fit.density import Density, densities
from symshrec.methods.fit.frame import frame_of
from symshrec.methods.fit.likelihood import RELATION_DEG, RELATION_DISTANCE, ascended, divergence
from symshrec.methods.m4.confidence import confidences
from symshrec.methods.m4.search import searched
from symshrec.methods.m4.settings import M4Settings
from symshrec.planes import Planes

# Lengths are shares of the cloud's size (see `frame_of`), divergences in nats a point.
COARSE_POINTS, COARSE_STEPS, COARSE_STEP = 200, 2, 0.12
MIDDLE_POINTS, MIDDLE_STEPS = 800, 4
FINE_POINTS, FINE_STEPS = 1500, 3
LONGEST_STEP = 0.05
HOPELESS = (0.6, 0.5, 0.3, 0.2, 0.12)  # divergences beyond which a candidate goes, stage by stage
LIKELY, TIED = 0.08, 0.025  # divergences above the best plane's up to which planes are completed, and tied together
GROUP = 0.015  # divergence above the best plane's up to which planes are aligned together
ALIGNED = 0.1  # least confidence of another plane that is aligned, on its own


@torch.inference_mode()
def detect_planes(points, settings: M4Settings | None = None) -> Planes:
    """The mirror planes of one cloud, by descending confidence.

    Confidence says how likely a plane is a symmetry, from how well the mirrored cloud fits the cloud's own density. The
    order of the points changes nothing. Pose and scale change which points are used first and how the grid lies: on
    noisy clouds some hundredths of a degree, and up to half a percent of the diagonal where only the ends of the cloud
    tell an offset. A sphere or a surface of revolution, symmetric about infinitely many planes, gets some of them, at
    least `separation_deg` apart.

    Args:
        points: (N, 3) tensor (worked on where it lies) or array, any unit. Coincident points count once; fewer than
            four distinct points, or points on a straight line, have no planes.
        settings: the default ones where omitted.

    Returns:
        Planes in the coordinates of the points.

    Raises:
        ValueError: for a wrong shape or values that are not finite.
    """
    settings = settings or M4Settings()
    frame = frame_of(points, settings.points)
    if frame is None:
        return Planes.empty()
    search = Search(frame.points, settings)
    normals, offsets, divergences = search.planes()
    sureness = confidences(divergences, len(frame.points), settings.calibration)
    alignment = AlignmentSettings(neighbours=settings.neighbours, rounds=settings.rounds)
    group = divergences < divergences.min() + GROUP
    rest = (sureness >= ALIGNED) & ~group
    for rows, together in ((group, settings.together), (rest, False)):
        if rows.any():
            normals[rows], offsets[rows] = aligned(frame.points, normals[rows], offsets[rows], together, alignment)
    kept = distinct(normals, -sureness, settings.separation_deg)
    return frame.planes(normals[kept], offsets[kept], sureness[kept]).ranked()


class Search:
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
