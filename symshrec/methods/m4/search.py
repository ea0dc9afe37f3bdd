"""M4 step 2: candidate planes: directions of a hemisphere, scored by the density at the mirrored points."""

from functools import cache

import torch
from torch import Tensor

from symshrec.geometry.hemisphere import hemisphere_directions
from symshrec.methods.fit.density import Density
from symshrec.methods.fit.steps import columns, mirror_images

AROUND = 8  # neighbours of a direction, beside itself
SEARCHED = 128  # points mirrored in every direction


@cache
def hemisphere(count: int) -> tuple[Tensor, Tensor]:
    """`count` directions (count, 3) spread evenly over half a sphere (a Fibonacci spiral), and their nearest ones.

    Returns:
        Directions, and indices (count, AROUND) of each one's neighbours, opposite directions being the same.
    """
    directions = torch.from_numpy(hemisphere_directions(count)).float()
    return directions, (directions @ directions.T).abs().topk(AROUND + 1).indices[:, 1:]


def searched(density: Density, directions: int, most: int) -> tuple[Tensor, Tensor]:
    """Planes through the origin in which the cloud looks mirrored: normals (K, 3) and offsets (K,), the best first.

    The score is a weighted sum of the density at the mirrored points. The density saturates, so that a crowded apex
    does not outweigh the rest, and points count the more the sparser it is around them.

    Args:
        density: of a cloud any prefix of which is a random sample of it. directions: tried. most: K at most.
    """
    tried, around = (each.to(density.cells.device) for each in hemisphere(directions))
    points = columns(density.points[:SEARCHED])
    weights = 1 - _saturated(density, points)
    images = mirror_images(points, tried, tried.new_zeros(len(tried)))
    scores = _saturated(density, images) @ weights
    peaks = torch.nonzero((scores[:, None] >= scores[around]).all(1))[:, 0]
    peaks = peaks[torch.argsort(scores[peaks], descending=True, stable=True)[:most]]
    return tried[peaks], torch.zeros(len(peaks), device=tried.device)


def _saturated(density: Density, places: Tensor) -> Tensor:
    values = density.nearest(places)
    return values / (values + density.mean)
