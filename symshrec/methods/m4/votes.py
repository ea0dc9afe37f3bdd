"""M4 step 2: candidate planes that pairs of points vote for, wherever the cloud's centroid lies.

The plane midway between two points is a vote where the surface at one mirrors that at the other: as steep
and as curved. Where parts are missing the centroid leaves the planes of symmetry, and these votes do not.
"""

from functools import cache
from math import cos, radians

import numpy as np
import torch
from torch import Tensor

from symshrec.methods.fit.density import Density
from symshrec.methods.fit.steps import columns, mirror_images
from symshrec.methods.fit.surface import Neighbours, smallest_eigenvectors

VOTERS = 400  # points, drawn evenly from the surface
AROUND = 16  # points that tell how the surface lies at one
SHORTEST = 0.12  # distance of a pair: nearer points tell a direction badly
STEEP = 0.97  # least cosine between one's normal and the mirrored one of the other
CURVED = 0.03  # most difference of their curvatures
MOST, JUDGES = 3000, 96  # votes that are scored, and points that score them
LEAST_MOVE = 1.5  # bandwidths that a point is moved by for its image to count
SAME_DEG, SAME = 8.0, 0.04  # planes nearer to each other than this, in degrees and in shares of the size, are one
AROUND_DEG, AROUND_OFFSET = 16.0, 0.08  # a vote with a better one so near is no candidate
SHIFTS, SHIFT = 10, 0.015  # to either side of the centroid, at which the principal axes are tried, and their step


def voted(even: Tensor, density: Density, neighbours: Neighbours, most: int) -> tuple[Tensor, Tensor, Tensor]:
    """Planes from pairs of points: normals (K, 3), offsets (K,) and scores (K,), the best first.

    Args:
        even: (n, 3), the cloud evened. density: of it. neighbours: in it. most: K at most.
    """
    voters = even[:VOTERS]
    first, second = (each.to(even.device) for each in _pairs(len(voters)))
    normals, curved = _surface(voters, even, neighbours)
    apart = voters[first] - voters[second]
    lengths = apart.norm(dim=1)
    across = apart / lengths.clamp_min(1e-9)[:, None]
    one, other = normals[first], normals[second]
    images = (one * other).sum(1) - 2 * (one * across).sum(1) * (other * across).sum(1)
    good = (lengths > SHORTEST) & (images.abs() > STEEP) & ((curved[first] - curved[second]).abs() < CURVED)
    rows = torch.nonzero(good)[:MOST, 0]
    across = across[rows]
    offsets = ((voters[first[rows]] + voters[second[rows]]) * across).sum(1) / 2
    axes, places = _principal(even)
    across, offsets = torch.cat([across, axes]), torch.cat([offsets, places])
    scores = overlap(density, even[:JUDGES], across, offsets)
    return best_apart(across, offsets, scores, most, AROUND_DEG, AROUND_OFFSET)


def _principal(points: Tensor) -> tuple[Tensor, Tensor]:
    """Planes across the principal axes of points (n, 3), at offsets around the centroid's."""
    centre = points.mean(0)
    axes = torch.linalg.eigh((points - centre).T @ (points - centre))[1].T
    shifts = torch.arange(-SHIFTS, SHIFTS + 1, device=points.device) * SHIFT
    return axes.repeat_interleave(len(shifts), 0), ((axes @ centre)[:, None] + shifts).flatten()


def overlap(density: Density, points: Tensor, normals: Tensor, offsets: Tensor) -> Tensor:
    """The share (K,) of points (Q, 3) that a plane moves to where the cloud is, in terms of a saturating density."""
    points = columns(points)
    values = density.nearest(mirror_images(points, normals, offsets))
    moved = torch.addmm(offsets[:, None], normals, points, beta=-1).abs() > LEAST_MOVE / 2 * density.bandwidth
    return (values / (values + 0.5 * density.mean) * moved).mean(1)


def best_apart(
    normals: Tensor, offsets: Tensor, scores: Tensor, most: int, angle_deg: float = SAME_DEG, distance: float = SAME
) -> tuple[Tensor, Tensor, Tensor]:
    """At most `most` planes, the best first, each over `angle_deg` or `distance` from all before it."""
    order = torch.argsort(scores, descending=True, stable=True)
    planes = torch.cat([normals, offsets[:, None]], 1)[order].cpu().numpy()
    free, kept = np.ones(len(planes), dtype=bool), []
    while len(kept) < most and free.any():
        best = int(free.argmax())
        kept.append(best)
        cosines = planes[:, :3] @ planes[best, :3]
        gaps = np.abs(planes[:, 3] - np.sign(cosines) * planes[best, 3])
        free &= (np.abs(cosines) <= cos(radians(angle_deg))) | (gaps >= distance)
        free[best] = False
    rows = order[torch.tensor(kept, dtype=torch.int64, device=order.device)]
    return normals[rows], offsets[rows], scores[rows]


@cache
def _pairs(count: int) -> tuple[Tensor, Tensor]:
    """All pairs of `count` rows, in an order that is random and always the same."""
    first, second = torch.triu_indices(count, count, 1)
    order = torch.randperm(len(first), generator=torch.Generator().manual_seed(0))
    return first[order], second[order]


def _surface(points: Tensor, even: Tensor, neighbours: Neighbours) -> tuple[Tensor, Tensor]:
    """Unit normals (M, 3) of the surface at points (M, 3), and its curvatures there: the shares of variance off it."""
    around = even[neighbours.query(points, min(AROUND, len(even)))]
    around = around - around.mean(1, keepdim=True)
    x, y, z = around.double().unbind(-1)
    entries = torch.stack([(a * b).mean(1) for a, b in ((x, x), (x, y), (x, z), (y, y), (y, z), (z, z))])
    normals = smallest_eigenvectors(entries).to(points.dtype)
    off = (around @ normals[..., None]).square().mean((1, 2))
    return normals, off / around.square().sum(-1).mean(1).clamp_min(1e-12)
