"""M4 step 4: local planes of a cloud from re-weighted PCA, and which points lie on the surface, in batched torch."""

from dataclasses import dataclass

import numpy as np
import torch
from scipy.spatial import cKDTree
from torch import Tensor

CELLS = 1 << 25  # distances held at once where no kd-tree is used


class Neighbours:
    """Nearest neighbours among (N, 3) points: a kd-tree on the CPU, all distances in chunks on other devices."""

    def __init__(self, points: Tensor):
        self.points = points
        self.tree = None
        if points.device.type == "cpu":
            self.tree = cKDTree(points.numpy().astype(np.float64), leafsize=12, balanced_tree=False, compact_nodes=False)

    def query(self, queries: Tensor, count: int) -> Tensor:
        """Indices (..., count) of the nearest points to (..., 3) queries, nearest first."""
        if self.tree is not None:
            _, nearest = self.tree.query(queries.numpy(), count)
            return torch.from_numpy(np.asarray(nearest).reshape(*queries.shape[:-1], count))
        flat = queries.reshape(-1, 3)
        rows = max(1, CELLS // max(1, len(self.points)))
        parts = [torch.cdist(part, self.points).topk(count, largest=False).indices for part in flat.split(rows)]
        return torch.cat(parts).reshape(*queries.shape[:-1], count)


@dataclass(frozen=True, eq=False)
class Surface:
    """N points with the local plane at each.

    points, normals (N, 3) float32; anchors (N, 3): points of the local planes; weights (N,) in [0, 1]: how surely the
    point lies on the surface; noise (N,): distance of the point from its plane.
    """

    points: Tensor
    normals: Tensor
    anchors: Tensor
    weights: Tensor
    nearest: Tensor
    neighbours: Neighbours


def smallest_eigenvector(matrices: Tensor) -> Tensor:
    """Unit eigenvectors (N, 3) of the smallest eigenvalues of symmetric (N, 3, 3) matrices, in closed form."""
    matrices = matrices.double()
    trace = matrices.diagonal(dim1=-2, dim2=-1).sum(-1).clamp_min(1e-300)
    a = matrices / trace[:, None, None]
    xx, yy, zz = a[:, 0, 0] - 1 / 3, a[:, 1, 1] - 1 / 3, a[:, 2, 2] - 1 / 3
    xy, xz, yz = a[:, 0, 1], a[:, 0, 2], a[:, 1, 2]
    p = ((xx * xx + yy * yy + zz * zz + 2 * (xy * xy + xz * xz + yz * yz)) / 6).sqrt().clamp_min(1e-30)
    det = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz)
    angle = torch.acos((det / (2 * p**3)).clamp(-1, 1)) / 3
    smallest = 2 * p * torch.cos(angle + 2 * torch.pi / 3)
    xx, yy, zz = xx - smallest, yy - smallest, zz - smallest
    crosses = torch.stack(
        [
            torch.stack([xy * yz - xz * yy, xz * xy - xx * yz, xx * yy - xy * xy], -1),
            torch.stack([xy * zz - xz * yz, xz * xz - xx * zz, xx * yz - xy * xz], -1),
            torch.stack([yy * zz - yz * yz, yz * xz - xy * zz, xy * yz - yy * xz], -1),
        ],
        1,
    )  # of each pair of rows of A − λ
    squared = crosses.square().sum(-1)
    best = squared.argmax(1)
    rows = torch.arange(len(a), device=a.device)
    vectors, lengths = crosses[rows, best], squared[rows, best].sqrt()
    fallback = torch.zeros_like(vectors)
    fallback[:, 2] = 1.0
    return torch.where(lengths[:, None] > 1e-14, vectors / lengths.clamp_min(1e-300)[:, None], fallback)


def local_surface(points: Tensor, neighbours: int, scales: tuple[float, ...]) -> Surface:
    """The local planes by PCA over the nearest points, re-weighted at each of the falling `scales`."""
    lookup = Neighbours(points)
    count = min(neighbours, len(points))
    nearest = lookup.query(points, count)
    offsets = points[nearest] - points[:, None]  # (N, k, 3)
    weights = torch.ones_like(offsets[..., 0])
    for scale in (None, *scales):
        if scale is not None:
            weights = (1 + (residuals / scale).square()).square().reciprocal()
        total = weights.sum(1, keepdim=True)
        means = (weights[..., None] * offsets).sum(1) / total
        centred = offsets - means[:, None]
        normals = smallest_eigenvector((weights[..., None] * centred).mT @ centred).to(points.dtype)
        residuals = (centred @ normals[..., None])[..., 0]
    own = (means * normals).sum(-1)
    support = weights.mean(1)
    certainty = (1 + (own / scale).square()).square().reciprocal() if scales else torch.ones_like(own)
    return Surface(points, normals, points + means, certainty * support, nearest, lookup)
