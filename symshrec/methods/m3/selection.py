"""§3.3 step 3: candidates by Chamfer distance, overlapping ones removed greedily, computing no more than needed."""

import heapq

import numpy as np
from scipy.spatial import cKDTree

STRIDES = (64, 8, 4, 2, 1)  # shares of the cloud, 1/stride each, on which a candidate's distance is bounded from below


def select_planes(
    tree: cKDTree, normals: np.ndarray, points: np.ndarray, chamfer_limit: float, separation_deg: float
) -> tuple[np.ndarray, np.ndarray]:
    """Planes by ascending Chamfer distance, each kept if its normal is over `separation_deg` from all kept before it.

    The distance is that between the cloud and its mirror image: the sum of squared distances to the nearest point, both
    ways. A mirror is an isometry and its own inverse, so both ways sum to the same, and the sum over some of the points
    bounds it from below. Candidates wait in a queue by that bound. The first of the queue is dropped if its normal is
    close to that of a kept plane, kept if its bound is exact, else bounded on more points. This keeps what sorting all
    the exact distances would; equal distances go by the candidates' order.

    Args:
        tree: over the cloud's (N, 3) points, neighbours in space near each other in memory for speed.
        normals, points: (C, 3) each, the candidates.
        chamfer_limit: distances from here on are no symmetry.

    Returns:
        Indices of the kept candidates, int64, and their distances, both by ascending distance.
    """
    shares = _disjoint_shares(np.asarray(tree.data))
    cosine = np.cos(np.deg2rad(separation_deg))
    queue = [(0.0, candidate, 0) for candidate in range(len(normals))]
    kept, distances = [], []
    while queue:
        bound, candidate, used = heapq.heappop(queue)
        if bound >= chamfer_limit:
            break
        if (np.abs(normals[kept] @ normals[candidate]) >= cosine).any():
            continue
        if used == len(shares):
            kept.append(candidate)
            distances.append(bound)
            continue
        bound += 2 * _squared_distances(tree, shares[used], normals[candidate], points[candidate])
        heapq.heappush(queue, (bound, candidate, used + 1))
    return np.array(kept, dtype=np.int64), np.array(distances, dtype=np.float64)


def _disjoint_shares(cloud: np.ndarray) -> list[np.ndarray]:
    """The cloud in parts, the first k of which together hold every STRIDES[k − 1]-th point."""
    rows = np.arange(len(cloud))
    share = np.full(len(cloud), len(STRIDES))
    for level, stride in reversed(list(enumerate(STRIDES))):
        share[rows % stride == 0] = level
    return [cloud[share == level] for level in range(len(STRIDES))]


def _squared_distances(tree: cKDTree, points: np.ndarray, normal: np.ndarray, origin: np.ndarray) -> float:
    """Sum over the mirrored points of the squared distance to the nearest point of the cloud."""
    mirrored = points - np.outer(2 * ((points - origin) @ normal), normal)
    nearest, _ = tree.query(mirrored)
    return float(nearest @ nearest)
