"""M4 step 4: the offset of a plane that the surface slides along, from the two ends of the cloud.

A cylinder looks the same from its mid-plane and from one beside it, but for its ends. The offset then is the middle
of two change points of the density along the normal, each by maximum likelihood.
"""

import torch
from torch import Tensor

WINDOW = 0.025  # of the extent: how much of the density around an end is looked at
OUTER = 0.02  # of the points beyond either place that the search for an end starts from


def near_ends(heights: Tensor) -> Tensor:
    """Which of the heights (N,) have a part in where the ends are."""
    low, high = _extent(heights.sort().values)
    return (heights < low + 2 * WINDOW * (high - low)) | (heights > high - 2 * WINDOW * (high - low))


def end_offset(heights: Tensor, weights: Tensor) -> Tensor:
    """The middle between the two ends of weighted heights (N,) along a normal."""
    heights, order = heights.double().sort()
    weights = weights[order].double()
    return (_upper_end(heights, weights) - _upper_end(-heights.flip(0), weights.flip(0))) / 2


def _upper_end(heights: Tensor, weights: Tensor) -> Tensor:
    """Where the density of ascending heights falls from one level to a lower one, near the upper end.

    The mean over all such places, each as likely as the two levels make the heights around it, which errs less than the
    likeliest does.
    """
    low, high = _extent(heights)
    window = WINDOW * (high - low)
    rows = torch.arange(int(torch.searchsorted(heights, high - window)), len(heights), device=heights.device)
    edges, mass = heights[rows], weights.cumsum(0)
    below = mass[rows] - mass[torch.searchsorted(heights, edges - window)]
    above = mass[torch.searchsorted(heights, edges + window, right=True) - 1] - mass[rows]
    rates = (below / window, above / window, (below + above) / (2 * window))
    logs = [rate.clamp_min(1e-12).log() for rate in rates]
    likelihood = below * logs[0] + above * logs[1] - (below + above) * logs[2]
    falls = below > above
    if not falls.any():
        return edges[0]
    return (edges * torch.where(falls, likelihood, -torch.inf).softmax(0)).sum()


def _extent(heights: Tensor) -> tuple[Tensor, Tensor]:
    """Between which places all but the outermost of ascending heights are."""
    last = len(heights) - 1
    return heights[int(OUTER * last)], heights[int((1 - OUTER) * last)]
