"""Not in the paper: what both baselines share, a plane fitted by ICP and the share of points that it mirrors well."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from symshrec.geometry.trees import midpoint_tree
from symshrec.methods.fit.frame import FEWEST_POINTS, checked
from symshrec.planes import Planes, axis_angles

CONVERGED = 1e-5  # change of normal and offset, the latter as a share of the cloud's spread


@dataclass(frozen=True, eq=False)
class Target:
    """A cloud to be mapped onto itself: its points (N, 3) in a random order, a search tree, and two lengths.

    spread: the root mean square distance from the centroid. noise: how far from the cloud a mirrored point may land.
    """

    points: np.ndarray
    tree: cKDTree
    spread: float
    noise: float

    @classmethod
    def of(cls, points: np.ndarray, most: int, within: float) -> "Target | None":
        """At most `most` points of a cloud, the same in whatever order and pose it comes; None for too few.

        Args:
            points: (N, 3). within: the noise, in median distances of a point from the nearest other one.

        Raises:
            ValueError: for a wrong shape or values that are not finite.
        """
        points = np.unique(checked(points), axis=0)
        if len(points) < FEWEST_POINTS:
            return None
        distances = np.linalg.norm(points - points.mean(axis=0), axis=1)
        points = points[np.argsort(distances, kind="stable")][np.random.default_rng(0).permutation(len(points))[:most]]
        tree = midpoint_tree(points)
        nearest = np.median(tree.query(points, [2])[0])
        return cls(points, tree, float(np.sqrt(np.square(distances).mean())), within * float(nearest))

    def distances(self, normals: np.ndarray, offsets: np.ndarray, probes: int, limit: float) -> np.ndarray:
        """How far the first `probes` points, mirrored in planes (K, 3), (K,), land from the cloud: (K, probes).

        Infinite beyond `limit`.
        """
        images = Planes(normals, offsets[:, None] * normals).mirror(self.points[:probes])
        return self.tree.query(images, distance_upper_bound=limit)[0]

    def support(self, normals: np.ndarray, offsets: np.ndarray) -> np.ndarray:
        """The share of the points that planes (K, 3), (K,) mirror to within the noise of the cloud: (K,)."""
        return np.isfinite(self.distances(normals, offsets, len(self.points), self.noise)).mean(axis=1)


def polished(target: Target, normal: np.ndarray, offset: float, probes: int, rounds: int, kept: float):
    """The plane n·x = offset after `rounds` of trimmed ICP at most: each pairs mirrored points with their nearest ones.

    For pairs x, y the plane that mirrors x nearest to y, in least squares, has as its normal the least eigenvector of
    2 Σ (x̃ ỹᵀ + ỹ x̃ᵀ) − k δ δᵀ and the offset n·(x̄ + ȳ) / 2; x̃, ỹ are centred and δ = x̄ − ȳ.

    Args:
        kept: the share of the pairs, the nearest ones, that count.
    """
    x_all = target.points[:probes]
    count = max(round(kept * len(x_all)), FEWEST_POINTS)
    for _ in range(rounds):
        images = x_all - 2 * (x_all @ normal - offset)[:, None] * normal
        distances, nearest = target.tree.query(images)
        rows = np.argpartition(distances, min(count, len(distances)) - 1)[:count]
        x, y = x_all[rows], target.points[nearest[rows]]
        gap = x.mean(axis=0) - y.mean(axis=0)
        products = 2 * (x - x.mean(axis=0)).T @ (y - y.mean(axis=0))
        before, previous = normal, offset
        normal = np.linalg.eigh(products + products.T - len(x) * np.outer(gap, gap))[1][:, 0]
        normal = normal if normal @ before > 0 else -normal
        offset = normal @ (x.mean(axis=0) + y.mean(axis=0)) / 2
        if np.abs(normal - before).max() + abs(offset - previous) / target.spread < CONVERGED:
            break
    return normal, float(offset)


def distinct(planes: Planes, separation_deg: float, most: int) -> Planes:
    """The most confident planes, at least so far apart, at most so many, ranked."""
    ranked, kept = planes.ranked(), []
    close = np.rad2deg(axis_angles(ranked.normals, ranked.normals)) < separation_deg
    for row in range(len(ranked)):
        if len(kept) < most and not close[row, kept].any():
            kept.append(row)
    return ranked[np.array(kept, dtype=int)]
