"""M4 step 1: a cloud made as dense everywhere as where it is sparse, so that only its surface speaks, not its sampling.

Poisson-disc thinning: in a random order, a point stays if none that stays lies nearer than r. With r the .9 quantile of
the distances to the nearest point, sparse parts stay whole, and every point has one that stays within r.
"""

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from symshrec.methods.fit.surface import Neighbours

QUANTILE = 0.9  # of the distances to the nearest other point
ROUNDING = 1.003  # times that distance, so that on a grid, where many are equal, rounding decides nothing
MEASURED = 2000  # points whose nearest other point is looked for
SPREAD, REACH, AROUND = 1000, 8, 32  # points at which density is measured, by the eighth neighbour; medians over 32
TINY = 1e-9  # least distance that has a logarithm
EVEN = 0.15  # unevenness of an even sample of thousands of points; of hundreds, chance makes it up to .3


@dataclass(frozen=True, eq=False)
class Even:
    """rows (n,): of the points that stay, any prefix being a random sample. spacing: no two of them are nearer."""

    rows: Tensor
    spacing: float


def evened(neighbours: Neighbours) -> Even:
    """Thin a cloud whose points are in random order."""
    points = neighbours.points
    distances = neighbours.distances(points[:MEASURED], 2)[:, 1]
    spacing = ROUNDING * float(torch.quantile(distances, QUANTILE))
    first, second = neighbours.pairs(spacing)
    return Even(torch.from_numpy(_first_come(first, second, len(points))).to(points.device), spacing)


def unevenness(neighbours: Neighbours) -> float:
    """How far the density of a cloud differs from place to place: `EVEN` and less where it does not.

    The way from the .1 to the .9 quantile of the logarithm of the distance to the eighth neighbour, smoothed by the
    median over the places around: .7 where points in sparse parts lie twice as far apart as in dense ones.
    """
    points = neighbours.points[:SPREAD]
    reach = neighbours.distances(points, REACH + 1)[:, -1].clamp_min(TINY).log()
    smooth = reach[Neighbours(points).query(points, min(AROUND, len(points)))].median(1).values
    low, high = torch.quantile(smooth, smooth.new_tensor([1 - QUANTILE, QUANTILE])).tolist()
    return high - low


def _first_come(first: np.ndarray, second: np.ndarray, count: int) -> np.ndarray:
    """Rows that stay when each of `count` rows stays unless an earlier one that stays is paired with it.

    Args:
        first, second: the paired rows, first < second.
    """
    undecided = np.ones(count, dtype=bool)
    stays = np.zeros(count, dtype=bool)
    while len(first):
        waits = np.zeros(count, dtype=bool)
        waits[second] = True
        chosen = undecided & ~waits
        stays |= chosen
        undecided &= waits
        undecided[second[chosen[first]]] = False
        open_ = undecided[first] & undecided[second]
        first, second = first[open_], second[open_]
    return np.flatnonzero(stays | undecided)
