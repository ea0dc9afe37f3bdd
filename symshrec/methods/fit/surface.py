"""M4 step 4: nearest neighbours, and the local planes of a cloud by re-weighted PCA."""

import numpy as np
import torch
from scipy.spatial import cKDTree
from torch import Tensor

CELLS = 1 << 25  # distances held at once where no kd-tree is used
PARALLEL_ROWS = 1e-14  # squared length, relative to the trace, below which a matrix has no single smallest eigenvector


class Neighbours:
    """Nearest neighbours among (N, 3) points: a kd-tree on the CPU, all distances in chunks on other devices."""

    def __init__(self, points: Tensor):
        self.points = points
        self.tree = None
        if points.device.type == "cpu":
            self.tree = cKDTree(points.numpy(), leafsize=16, balanced_tree=False)

    def query(self, queries: Tensor, count: int) -> Tensor:
        """Indices (..., count) of the nearest points to (..., 3) queries, nearest first."""
        shape = (*queries.shape[:-1], count)
        if self.tree is not None:
            _, nearest = self.tree.query(queries.numpy(), count)
            return torch.from_numpy(np.reshape(nearest, shape))
        rows = max(1, CELLS // len(self.points))
        found = [
            torch.cdist(part, self.points, compute_mode="donot_use_mm_for_euclid_dist").topk(count, largest=False)[1]
            for part in queries.reshape(-1, 3).split(rows)
        ]
        return torch.cat(found).reshape(shape)

    def distances(self, queries: Tensor, count: int) -> Tensor:
        """Distances (M, count) float32 to the nearest points to (M, 3) queries, nearest first."""
        if self.tree is not None:
            return torch.from_numpy(self.tree.query(queries.numpy(), count)[0]).float()
        nearest = self.points[self.query(queries, count)]
        return (nearest - queries[:, None]).norm(dim=-1)

    def within(self, queries: Tensor, reach: float) -> tuple[Tensor, Tensor]:
        """The nearest point to each of (..., 3) queries, where one is within `reach`.

        Returns:
            Distances (...), inf where none is; indices (...), then one past the last.
        """
        if self.tree is not None:
            distances, nearest = self.tree.query(queries.numpy(), 1, distance_upper_bound=reach)
            return torch.from_numpy(distances).float(), torch.from_numpy(nearest)
        nearest = self.query(queries, 1)[..., 0]
        distances = (self.points[nearest] - queries).norm(dim=-1)
        far = distances > reach
        return distances.masked_fill(far, torch.inf), nearest.masked_fill(far, len(self.points))

    def pairs(self, reach: float) -> tuple[np.ndarray, np.ndarray]:
        """All pairs of rows of points nearer to each other than `reach`, the lower row first."""
        tree = self.tree or cKDTree(self.points.cpu().numpy(), leafsize=16, balanced_tree=False)
        found = tree.query_pairs(reach, output_type="ndarray")
        return found.min(1), found.max(1)


def local_planes(around: Tensor, scales: tuple[float, ...]) -> tuple[Tensor, Tensor]:
    """Planes through what lies around N points, by PCA re-weighted by (1 + (distance / scale)²)⁻² at each scale.

    Args:
        around: (N, k, 3), the neighbours' places relative to each point.
        scales: falling; the last is about the distance that is still called on the surface.

    Returns:
        Unit normals (N, 3), and certainties (N,) in [0, 1]: how surely the point itself lies on the surface, from its
        distance to the plane and from how many of its neighbours lie in it.
    """
    x, y, z = around.permute(2, 1, 0).contiguous()  # (k, N) each, in which sums over k are fastest
    weights = torch.ones_like(x)
    for scale in scales:
        total = weights.sum(0)
        means = [(weights * each).sum(0) / total for each in (x, y, z)]
        u, v, w = (each - mean for each, mean in zip((x, y, z), means, strict=True))
        wu, wv = weights * u, weights * v
        entries = (wu * u, wu * v, wu * w, wv * v, wv * w, (weights * w).mul_(w))
        normals = smallest_eigenvectors(torch.stack([each.sum(0) for each in entries]).double()).to(around.dtype)
        across = normals.T / scale
        ratios = torch.addcmul(torch.addcmul(u * across[0], v, across[1]), w, across[2])
        weights = ratios.square_().add_(1).square_().reciprocal_()
    own = (torch.stack(means, 1) * normals).sum(1) / scales[-1]
    return normals, falling(own) * weights.mean(0)


def falling(ratios: Tensor) -> Tensor:
    """Geman and McClure's weight (1 + r²)⁻² of residuals r in units of the scale."""
    return (1 + ratios.square()).square().reciprocal()


def smallest_eigenvectors(entries: Tensor) -> Tensor:
    """Unit eigenvectors (N, 3) of the smallest eigenvalues of symmetric 3 × 3 matrices, in closed form.

    Args:
        entries: (6, N) float64: xx, xy, xz, yy, yz, zz.

    Returns:
        Where the smallest eigenvalue is not single, some unit vector.
    """
    entries = entries / (entries[0] + entries[3] + entries[5]).clamp_min(1e-300)
    xx, xy, xz, yy, yz, zz = entries
    xx, yy, zz = xx - 1 / 3, yy - 1 / 3, zz - 1 / 3
    spread = ((xx * xx + yy * yy + zz * zz + 2 * (xy * xy + xz * xz + yz * yz)) / 6).sqrt().clamp_min(1e-30)
    determinant = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz)
    angle = torch.acos((determinant / (2 * spread**3)).clamp(-1, 1)) / 3
    smallest = 2 * spread * torch.cos(angle + 2 * torch.pi / 3)
    xx, yy, zz = xx - smallest, yy - smallest, zz - smallest
    crosses = torch.stack(  # (pairs of rows, coordinates, N): parallel to the eigenvector, the longest most exactly
        [xy * yz - xz * yy, xz * xy - xx * yz, xx * yy - xy * xy,
         xy * zz - xz * yz, xz * xz - xx * zz, xx * yz - xy * xz,
         yy * zz - yz * yz, yz * xz - xy * zz, xy * yz - yy * xz]
    ).reshape(3, 3, -1)  # fmt: skip
    vectors, squared = crosses[0], crosses[0].square().sum(0)
    for other in crosses[1:]:
        length = other.square().sum(0)
        longer = length > squared
        vectors, squared = torch.where(longer, other, vectors), torch.where(longer, length, squared)
    lengths = squared.sqrt()
    upwards = entries.new_tensor([[0.0], [0.0], [1.0]])
    return torch.where(lengths > PARALLEL_ROWS, vectors / lengths.clamp_min(1e-300), upwards).T
