"""Geometry the methods share, in batched torch on any device."""

import torch
from torch import Tensor


def farthest_point_sampling(points: Tensor, lengths: Tensor, count: int) -> Tensor:
    """Exact farthest point sampling of ragged clouds (Qi et al. 2017), as M1 and M2 take their points.

    The first point is the one farthest from the centroid, so that the chosen set does not depend on the order of the
    points. A cloud with fewer distinct points than asked repeats its first one.

    Args:
        points: (ΣN, 3), the clouds end to end.
        lengths: (B,), points per cloud, each at least 1.
        count: points to choose from each.

    Returns:
        (B, count) int64, indices into each cloud, in the order chosen.

    Raises:
        ValueError: for a cloud without points or a count below 1.

    >>> line = torch.tensor([[0.0, 0, 0], [1, 0, 0], [4, 0, 0], [10, 0, 0]])
    >>> farthest_point_sampling(line, torch.tensor([4]), 3).tolist()
    [[3, 0, 2]]
    """
    if count < 1:
        raise ValueError(f"count is {count}; at least one point must be sampled")
    if not len(lengths) or int(lengths.min()) < 1:
        raise ValueError(f"lengths are {lengths.tolist()}; every cloud needs at least one point")
    padded = torch.nn.utils.rnn.pad_sequence(list(torch.split(points, lengths.tolist())), batch_first=True)  # (B, N, 3)
    outside = torch.arange(padded.shape[1], device=points.device) >= lengths[:, None]
    centroids = padded.sum(1) / lengths[:, None]
    coordinates = padded.permute(2, 0, 1).contiguous()  # (3, B, N): long rows, fast reductions
    rows = torch.arange(len(lengths), device=points.device)

    def squared_distances(to: Tensor) -> Tensor:
        x, y, z = (coordinates[axis] - to[:, axis, None] for axis in range(3))
        return x.square_().addcmul_(y, y).addcmul_(z, z)

    nearest = torch.full(padded.shape[:2], torch.inf, dtype=points.dtype, device=points.device)
    nearest.masked_fill_(outside, -1.0)
    chosen = torch.empty(len(lengths), count, dtype=torch.int64, device=points.device)
    latest = squared_distances(centroids).masked_fill_(outside, -1.0).argmax(1)
    for step in range(count):
        chosen[:, step] = latest
        torch.minimum(nearest, squared_distances(padded[rows, latest]), out=nearest)
        latest = nearest.argmax(1)
    return chosen
