"""M4 step 4: the offset of a plane that the surface slides along, from the two ends of the cloud.

A cylinder looks the same from its mid-plane and from one beside it, but for its ends. The offset then is the middle
of two change points of the density along the normal, each by maximum likelihood.
"""

import torch
from torch import Tensor

from symshrec.methods.refine.surface import Surface

WINDOW = 0.12  # of the extent: how much of the density around an end is looked at


def end_offset(heights: Tensor, weights: Tensor) -> Tensor:
    """The middle between the two ends of weighted heights (N,) along a normal."""
    order = torch.argsort(heights)
    heights, weights = heights[order].double(), weights[order].double()
    return (-_upper_end(-heights.flip(0), weights.flip(0)) + _upper_end(heights, weights)) / 2


def _upper_end(heights: Tensor, weights: Tensor) -> Tensor:
    """Where the density of ascending heights falls most clearly from one level to a lower one, near the upper end."""
    mass = weights.cumsum(0)
    low, high = (torch.searchsorted(mass, mass[-1] * share) for share in (0.02, 0.98))
    window = WINDOW * (heights[high] - heights[low])
    first = torch.searchsorted(heights, heights[high] - window)
    candidates = torch.arange(int(first), len(heights))
    edge = heights[candidates]
    start = torch.searchsorted(heights, edge - window)
    below = mass[candidates] - mass[start]
    stop = torch.searchsorted(heights, edge + window, right=True) - 1
    above = mass[stop] - mass[candidates]
    likelihood = below * (below / window).clamp_min(1e-12).log() + above * (above / window).clamp_min(1e-12).log()
    likelihood = likelihood - (below + above) * ((below + above) / (2 * window)).clamp_min(1e-12).log()
    return edge[torch.where(below > above, likelihood, -torch.inf).argmax()]


def with_ends(surface: Surface, normals: Tensor, offsets: Tensor, blind: Tensor) -> Tensor:
    """Offsets (K,), those the surface is `blind` (K,) to taken from the ends of the cloud."""
    offsets = offsets.clone()
    for row in torch.nonzero(blind)[:, 0].tolist():
        offsets[row] = end_offset(surface.points @ normals[row], surface.certainty.sqrt()).to(offsets.dtype)
    return offsets
