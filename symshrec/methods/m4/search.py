"""M4 step 2: directions of a hemisphere scored by the density at the mirrored points, and their local maxima."""

from functools import cache

import torch
from torch import Tensor

from symshrec.methods.m4.volume import look_up
from symshrec.methods.refine.alignment import mirrored

AROUND = 8  # neighbours of a direction, beside itself


@cache
def hemisphere(count: int) -> tuple[Tensor, Tensor]:
    """`count` directions (count, 3) spread evenly over half a sphere (a Fibonacci spiral), and their nearest ones.

    Returns:
        Directions, and indices (count, AROUND) of each one's neighbours, opposite directions being the same.
    """
    golden = torch.pi * (3 - 5**0.5)
    rows = torch.arange(count, dtype=torch.float64)
    z = (rows + 0.5) / count
    radius = (1 - z * z).sqrt()
    directions = torch.stack([radius * torch.cos(golden * rows), radius * torch.sin(golden * rows), z], 1).float()
    return directions, (directions @ directions.T).abs().topk(AROUND + 1).indices[:, 1:]


def direction_scores(
    volume: Tensor, points: Tensor, weights: Tensor, directions: Tensor, half_width: float, size: int
) -> Tensor:
    """Weighted mean density (D,) at (Q, 3) points mirrored across the planes through 0 in every direction (D, 3)."""
    return look_up(volume, mirrored(points, directions), half_width, size) @ weights / weights.sum().clamp_min(1e-12)


def local_maxima(scores: Tensor, around: Tensor, most: int) -> Tensor:
    """Directions that score no less than their neighbours, the best first, at most `most`."""
    peaks = torch.nonzero((scores[:, None] >= scores[around]).all(1))[:, 0]
    return peaks[torch.argsort(scores[peaks], descending=True, stable=True)[:most]]
