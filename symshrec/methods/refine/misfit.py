"""M4 step 5: how far a mirrored cloud is from the cloud, in units of how far the cloud's points are from each other."""

import torch
from torch import Tensor

from symshrec.methods.refine.surface import Surface

FAR = 0.1  # of the cloud's size: a point without a counterpart counts as this far from one


def misfit(surface: Surface, queries: Tensor, distances: Tensor, share: float = 1.0) -> Tensor:
    """Logarithm of the mean distance from mirrored points to the nearest point, over that from the points themselves.

    If the cloud is a sample of a symmetric surface, noise and all, its mirror image is another sample of it, and the
    ratio is 1 but for chance, whatever the noise and the density. About 0 for a symmetry, 0.25 and more for none.

    Args:
        queries: (Q,), rows of the points that were mirrored. distances: (K, Q), from their K images to the nearest
            point.
        share: of the distances to count, the smallest ones; below 1 where part of the cloud may be missing.

    Returns:
        (K,).
    """
    own = surface.spacing[queries]
    if share < 1:
        count = max(1, round(share * len(queries)))
        own, distances = own.sort().values[:count], distances.sort(-1).values[:, :count]
    floor = torch.finfo(own.dtype).tiny
    return (distances.clamp_max(FAR).mean(1).clamp_min(floor) / own.clamp_max(FAR).mean().clamp_min(floor)).log()
