"""M4 step 4: the offset of a plane that the surface slides along, from the two ends of the cloud.

A cylinder looks the same from its mid-plane and from one beside it, but for its ends. The offset then is the middle
of two change points of the density along the normal, each by maximum likelihood.
"""

import torch
from torch import Tensor

WINDOW = 0.12  # of the extent: how much of the density around an end is looked at


def end_offset(heights: Tensor) -> Tensor:
    """The middle between the two ends of heights (N,) along a normal."""
    heights = heights.sort().values.double()
    return (_upper_end(heights) - _upper_end(-heights.flip(0))) / 2


def _upper_end(heights: Tensor) -> Tensor:
    """Where the density of ascending heights falls most clearly from one level to a lower one, near the upper end."""
    count = len(heights)
    low, high = heights[int(0.02 * (count - 1))], heights[int(0.98 * (count - 1))]
    window = WINDOW * (high - low)
    first = torch.searchsorted(heights, high - window)
    rows = torch.arange(int(first), count, device=heights.device)
    edges = heights[rows]
    below = rows - torch.searchsorted(heights, edges - window)
    above = torch.searchsorted(heights, edges + window, right=True) - 1 - rows
    rates = (below / window, above / window, (below + above) / (2 * window))
    logs = [rate.clamp_min(1e-12).log() for rate in rates]
    likelihood = below * logs[0] + above * logs[1] - (below + above) * logs[2]
    return edges[torch.where(below > above, likelihood, -torch.inf).argmax()]
