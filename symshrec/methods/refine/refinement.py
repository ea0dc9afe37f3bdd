"""M4 step 4 for any method: planes refined by robust point-to-plane least squares, never to a worse fit."""

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from symshrec.methods.refine.alignment import Pairs, align, mirrored_nearest, moved
from symshrec.methods.refine.coupling import find_relations, images_of_planes
from symshrec.methods.refine.ends import with_ends
from symshrec.methods.refine.frame import frame_of
from symshrec.methods.refine.misfit import misfit
from symshrec.methods.refine.sharpening import sharpened
from symshrec.methods.refine.surface import SURFACE_SCALES, Surface, local_surface
from symshrec.planes import Planes

COARSE_POINTS, COARSE_SCALES = 500, ((0.1, 0.1, 0.07, 0.05, 0.03, 0.02, 0.015), (0.03, 0.02, 0.015))
FINE_POINTS, FINE_SCALES = 1200, (0.01, 0.007, 0.005)
FINAL_SCALES = (0.0035, 0.0025, 0.002, 0.002)
TIED_MISFIT = 0.2  # planes that fit no worse are estimated together
RELATION_DEG, RELATION_DISTANCE = 2.0, 0.03
FARTHEST_DEG, FARTHEST = 12.0, 0.12  # from the given plane, the second as a share of the cloud's size


@dataclass(frozen=True)
class RefineSettings:
    """points: most used of a cloud. neighbours: points in a local plane. together, rounds: as in `M4Settings`."""

    points: int = 8192
    neighbours: int = 12
    together: bool = True
    rounds: int = 2


@dataclass(frozen=True, eq=False)
class Refined:
    """planes: K refined planes, in the order and with the confidences given.

    residuals (K,): mean distance of mirrored points from the local plane at the nearest point, in the cloud's units.
    kept (K,) bool: where the given plane fitted better than any other found and was kept.
    """

    planes: Planes
    residuals: np.ndarray
    kept: np.ndarray


def refine_planes(points, planes: Planes, settings: RefineSettings | None = None) -> Refined:
    """Refine the planes that some method found, from errors of up to about 5° and 5 % of the cloud's size.

    A plane moves only where its mirror image then fits the cloud better, and no further than 12° and 12 %.

    Args:
        points: (N, 3) tensor or array; as `symshrec.methods.m4.detection.detect_planes` takes them.
        planes: in the coordinates of the points.
        settings: the default ones where omitted.

    Raises:
        ValueError: for a wrong shape or values that are not finite.
    """
    settings = settings or RefineSettings()
    frame = frame_of(points, settings.points)
    if frame is None or not len(planes):
        return Refined(planes, np.zeros(len(planes)), np.ones(len(planes), dtype=bool))
    surface = local_surface(frame.points, settings.neighbours, SURFACE_SCALES)
    given = frame.of(planes)
    normals, offsets = _refined(surface, *given, frame.prefix(COARSE_POINTS), frame.prefix(FINE_POINTS), settings)
    rows = frame.prefix(len(frame.points))
    worse = _misfits(surface, normals, offsets, rows) > _misfits(surface, *given, rows)
    cosines = (normals * given[0]).sum(1)
    worse |= cosines.abs() < np.cos(np.deg2rad(FARTHEST_DEG))
    worse |= (offsets * cosines.sign() - given[1]).abs() > FARTHEST
    normals = torch.where(worse[:, None], given[0], normals)
    offsets = torch.where(worse, given[1], offsets)
    residuals = frame.scale * _residuals(surface, normals, offsets, rows).double().cpu().numpy()
    kept = worse.cpu().numpy()
    found = frame.planes(normals, offsets, planes.confidences)
    where = kept[:, None]
    exact = Planes(
        np.where(where, planes.normals, found.normals), np.where(where, planes.points, found.points), planes.confidences
    )
    return Refined(exact, residuals, kept)


def refined(points, planes: Planes) -> Planes:
    """The planes of `refine_planes` alone."""
    return refine_planes(points, planes).planes


def _refined(surface: Surface, normals, offsets, coarse: Tensor, fine: Tensor, settings) -> tuple[Tensor, Tensor]:
    normals, offsets, misfits = _best_start(surface, normals, offsets, coarse, fine)
    if settings.together:
        for _ in range(2):
            normals, offsets, misfits = _replaced(surface, normals, offsets, misfits, coarse, fine)
    tied = misfits < TIED_MISFIT
    rows = torch.arange(len(surface.points), device=normals.device)
    for part, together in ((tied, settings.together), (~tied, False)):
        if not part.any():
            continue
        here, there = normals[part], offsets[part]
        relations = find_relations(here, there, RELATION_DEG, RELATION_DISTANCE) if together else None
        here, there, _ = align(surface, here, there, fine, FINE_SCALES, 2, relations)
        _, matches = mirrored_nearest(surface, here, there, rows)
        pairs = Pairs(surface, rows, matches)
        for scale in FINAL_SCALES:
            here, there, blind = moved(pairs, here, there, scale, 1e-6, relations)
        there = with_ends(surface, here, there, blind)
        if part is tied:
            here, there = sharpened(surface, here, there, relations, settings.rounds)
        normals[part], offsets[part] = here, there
    return normals, offsets


def _best_start(surface: Surface, normals, offsets, coarse: Tensor, fine: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Of the planes aligned from a large scale on, from a small one, and as given, each time what fits best."""
    best = normals.clone(), offsets.clone(), _misfits(surface, normals, offsets, fine)
    for scales in COARSE_SCALES:
        there, distances, blind = align(surface, normals, offsets, coarse, scales)
        distances = with_ends(surface, there, distances, blind)
        misfits = _misfits(surface, there, distances, fine)
        better = misfits < best[2]
        for kept, new in zip(best, (there, distances, misfits), strict=True):
            kept[better] = new[better]
    return best


def _replaced(surface: Surface, normals, offsets, misfits, coarse: Tensor, fine: Tensor):
    """Planes that do not fit yet replaced by images of those that do in each other, where these are near and fit."""
    good = misfits < TIED_MISFIT
    if good.all() or good.sum() < 2:
        return normals, offsets, misfits
    images, image_offsets = (each.flatten(0, 1) for each in images_of_planes(normals[good], offsets[good]))
    cosines = normals @ images.T
    nearest = cosines.abs().argmax(1)
    near = cosines.abs().amax(1) > np.cos(np.deg2rad(FARTHEST_DEG))
    there, distances = images[nearest], image_offsets[nearest]
    there, distances, _ = align(surface, there, distances, coarse, COARSE_SCALES[1])
    better = near & ~good
    new = _misfits(surface, there, distances, fine)
    better &= new < misfits
    return (
        torch.where(better[:, None], there, normals),
        torch.where(better, distances, offsets),
        torch.where(better, new, misfits),
    )


def _misfits(surface: Surface, normals: Tensor, offsets: Tensor, rows: Tensor) -> Tensor:
    return misfit(surface, rows, mirrored_nearest(surface, normals, offsets, rows)[0])


def _residuals(surface: Surface, normals: Tensor, offsets: Tensor, rows: Tensor) -> Tensor:
    """Mean distances (K,) of mirrored points from the local plane at the nearest point."""
    _, nearest = mirrored_nearest(surface, normals, offsets, rows)
    heights = normals @ surface.points[rows].T - offsets[:, None]
    gaps = surface.points[rows] - 2 * heights[..., None] * normals[:, None] - surface.anchors[nearest]
    return (gaps * surface.normals[nearest]).sum(-1).abs().mean(1)
