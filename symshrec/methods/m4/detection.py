"""M4, our training-free detector: one cloud in, its mirror planes out."""

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from symshrec.methods.m4.candidates import candidate_planes
from symshrec.methods.refine.alignment import Pairs, align, mirrored_nearest, moved
from symshrec.methods.refine.coupling import closure, distinct, find_relations
from symshrec.methods.refine.ends import with_ends
from symshrec.methods.refine.frame import frame_of
from symshrec.methods.refine.misfit import misfit
from symshrec.methods.refine.sharpening import sharpened
from symshrec.methods.refine.surface import SURFACE_SCALES, Surface, local_surface
from symshrec.planes import Planes

HOPELESS = 0.6  # misfit of a candidate that is not worth aligning any further
SPARE = 3  # planes kept besides the symmetric ones, with low confidence
MIDDLE_POINTS, MIDDLE_SCALES = 500, (0.015, 0.01)
GROUP_POINTS = 1200
GROUP_STAGES = ((0.015, 5.0), (0.01, 4.0), (0.007, 3.0), (0.005, 2.0))  # scale, tolerance in degrees
FINAL_POINTS = 4096
FINAL_SCALES, FINAL_TOLERANCE_DEG = (0.0035, 0.0025, 0.002, 0.002), 1.5
RELATION_DISTANCE = 0.04


@dataclass(frozen=True)
class M4Settings:
    """What there is to choose; lengths inside are shares of the cloud's size (see `frame_of`).

    Args:
        points: most points used of a cloud; the rest changes nothing.
        neighbours: points in a local plane.
        directions: normals tried in the search.
        candidates: local maxima of the search that are aligned.
        separation_deg: least angle between two planes, in degrees.
        max_planes: most planes returned.
        together: whether planes whose images in each other are planes as well are estimated together.
        rounds: of sharpening, each about a fifth of the time; 0 suffices for 1° and 1 %.
        middle_misfit, steepness: confidence is 1 / (1 + exp(steepness · (misfit − middle_misfit))).

    Raises:
        ValueError: naming the setting that is out of its range.
    """

    points: int = 8192
    neighbours: int = 12
    directions: int = 1500
    candidates: int = 40
    separation_deg: float = 5.0
    max_planes: int = 40
    together: bool = True
    rounds: int = 2
    middle_misfit: float = 0.16
    steepness: float = 40.0

    def __post_init__(self):
        ranges = {
            "points": (64, np.inf),
            "neighbours": (4, np.inf),
            "directions": (16, np.inf),
            "candidates": (1, np.inf),
            "separation_deg": (0, 90),
            "max_planes": (1, np.inf),
            "rounds": (0, np.inf),
            "middle_misfit": (0, np.inf),
            "steepness": (0, np.inf),
        }
        for name, (low, high) in ranges.items():
            if not low <= getattr(self, name) <= high:
                raise ValueError(f"{name} is {getattr(self, name)}, expected a number in [{low:g}, {high:g}]")


def detect_planes(points, settings: M4Settings | None = None) -> Planes:
    """The mirror planes of one cloud, by descending confidence.

    Confidence says how well the mirrored cloud fits the cloud, relative to the cloud's own density and noise; 0.5 parts
    symmetric from not. The order of the points changes nothing; pose and scale change the planes by rounding, and by
    the choice of points where there are more than `settings.points`. A sphere or a surface of revolution, symmetric
    about infinitely many planes, gets some of them, at least `separation_deg` apart.

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
    surface = local_surface(frame.points, settings.neighbours, SURFACE_SCALES)
    normals, offsets, misfits = _aligned_candidates(surface, settings)
    likely = misfits < settings.middle_misfit * 1.4
    likely[0] = True
    spare = normals[~likely], offsets[~likely], misfits[~likely]
    normals, offsets, misfits = _grouped(surface, normals[likely], offsets[likely], settings)
    normals, offsets, misfits = (torch.cat(both) for both in zip((normals, offsets, misfits), spare, strict=True))
    first = torch.cat([misfits[: len(misfits) - len(spare[0])] - 10, spare[2]])
    kept = distinct(normals, first, settings.separation_deg)[: settings.max_planes]
    confidences = torch.sigmoid(settings.steepness * (settings.middle_misfit - misfits[kept].double()))
    return frame.planes(normals[kept], offsets[kept], confidences).ranked()


def _aligned_candidates(surface: Surface, settings: M4Settings) -> tuple[Tensor, Tensor, Tensor]:
    """Normals, offsets and misfits of the search's candidates, best first, each aligned for itself."""
    normals, offsets, misfits = candidate_planes(surface, settings.directions, settings.candidates)
    kept = distinct(normals, misfits, settings.separation_deg * 0.8)
    kept = kept[(misfits[kept] < HOPELESS) | (torch.arange(len(kept), device=kept.device) < 1 + SPARE)]
    rows = _rows(surface, MIDDLE_POINTS)
    normals, offsets, blind = align(surface, normals[kept], offsets[kept], rows, MIDDLE_SCALES)
    offsets = with_ends(surface, normals, offsets, blind)
    rows = _rows(surface, GROUP_POINTS)
    misfits = misfit(surface, rows, mirrored_nearest(surface, normals, offsets, rows)[0])
    kept = distinct(normals, misfits, settings.separation_deg * 0.8)
    return normals[kept], offsets[kept], misfits[kept]


def _grouped(surface: Surface, normals: Tensor, offsets: Tensor, settings: M4Settings):
    """Likely planes, and their images in each other, aligned at falling scales; normals, offsets and misfits."""
    rows = _rows(surface, GROUP_POINTS)
    for scale, tolerance in GROUP_STAGES:
        if settings.together:
            normals, offsets = _completed(surface, normals, offsets, settings)
        distances, matches = mirrored_nearest(surface, normals, offsets, rows)
        misfits = misfit(surface, rows, distances)
        kept = distinct(normals, misfits, settings.separation_deg)[: settings.max_planes]
        kept = kept[(misfits[kept] < settings.middle_misfit * 1.4) | (torch.arange(len(kept), device=kept.device) < 1)]
        normals, offsets, misfits = normals[kept], offsets[kept], misfits[kept]
        relations = find_relations(normals, offsets, tolerance, RELATION_DISTANCE) if settings.together else None
        pairs = Pairs(surface, rows, matches[kept])
        for _ in range(3):
            normals, offsets, blind = moved(pairs, normals, offsets, scale, 1e-6, relations)
    rows = surface.certainty.topk(min(FINAL_POINTS, len(surface.points))).indices
    relations = find_relations(normals, offsets, FINAL_TOLERANCE_DEG, RELATION_DISTANCE) if settings.together else None
    distances, matches = mirrored_nearest(surface, normals, offsets, rows)
    pairs = Pairs(surface, rows, matches)
    for scale in FINAL_SCALES:
        normals, offsets, blind = moved(pairs, normals, offsets, scale, 1e-6, relations)
    offsets, misfits = with_ends(surface, normals, offsets, blind), misfit(surface, rows, distances)
    if settings.rounds and misfits[0] < settings.middle_misfit:
        normals, offsets = sharpened(surface, normals, offsets, relations, settings.rounds)
    return normals, offsets, misfits


def _completed(surface: Surface, normals: Tensor, offsets: Tensor, settings: M4Settings) -> tuple[Tensor, Tensor]:
    """The planes and their images in each other that are not among them."""
    more, more_offsets = closure(normals, offsets, settings.separation_deg, settings.max_planes)
    if not len(more):
        return normals, offsets
    more, more_offsets, _ = align(surface, more, more_offsets, _rows(surface, MIDDLE_POINTS), MIDDLE_SCALES)
    return torch.cat([normals, more]), torch.cat([offsets, more_offsets])


def _rows(surface: Surface, count: int) -> Tensor:
    return torch.arange(min(count, len(surface.points)), device=surface.points.device)
