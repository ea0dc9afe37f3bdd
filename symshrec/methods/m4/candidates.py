"""M4 steps 2 and 3: candidate planes from the density volume, aligned by look-ups in a volume of nearest points."""

import torch
from torch import Tensor

from symshrec.methods.m4.search import direction_scores, hemisphere, local_maxima
from symshrec.methods.m4.volume import OUTSIDE, density_volume, look_up, nearest_volume
from symshrec.methods.refine.alignment import Pairs, mirrored, mirrored_nearest, moved
from symshrec.methods.refine.misfit import misfit
from symshrec.methods.refine.surface import Surface

SIZE = 48  # cells along an edge of the volumes
BLUR = 0.03  # of the density, as a share of the cloud's size
TARGETS = 1024  # points in the volume of nearest points
REACH = 2  # cells around each
SEARCHED = 256  # points mirrored in every direction
ALIGNED = 240  # points mirrored in every candidate
SCALES = (0.05, 0.05, 0.05, 0.04, 0.03, 0.03, 0.02, 0.02)
DAMPING = 1e-3


def candidate_planes(surface: Surface, directions: int, most: int) -> tuple[Tensor, Tensor, Tensor]:
    """Planes near which the cloud may be symmetric, within about 2° and 1 % of the size.

    Args:
        surface: in its own frame, its first points being a random sample of it.
        directions: number of normals tried.
        most: number of candidates.

    Returns:
        Normals (K, 3), offsets (K,) and misfits (K,).
    """
    points = surface.points
    half_width = 1.1 * float(points.abs().max().clamp_max(1.0))
    volume = density_volume(points, half_width, SIZE, BLUR)
    queries = points[:SEARCHED]
    weights = 1 - look_up(volume, queries, half_width, SIZE)
    tried, around = (each.to(points.device) for each in hemisphere(directions))
    scores = direction_scores(volume, queries, weights, tried, half_width, SIZE)
    peaks = local_maxima(scores, around, most)
    normals, offsets = tried[peaks], torch.zeros(len(peaks), device=points.device)
    nearest = nearest_volume(points[:TARGETS], half_width, SIZE, REACH)
    rows = torch.arange(min(ALIGNED, len(points)), device=points.device)
    for scale in SCALES:
        matches = look_up(nearest, mirrored(points[rows], normals, offsets), half_width, SIZE)
        pairs = Pairs(surface, rows, matches.clamp_min(0), (matches != OUTSIDE).to(points.dtype))
        normals, offsets, _ = moved(pairs, normals, offsets, scale, DAMPING)
    distances, _ = mirrored_nearest(surface, normals, offsets, rows)
    return normals, offsets, misfit(surface, rows, distances)
