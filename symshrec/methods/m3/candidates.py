"""§3.3 step 2: local maxima of the diffusion function, and a candidate plane for every pair of them."""

import numpy as np
from scipy.spatial import cKDTree

FIRST_LOOK = 8  # neighbours that rule out nearly every point before the full neighbourhood is asked for


def local_maxima(tree: cKDTree, values: np.ndarray, neighbours: int) -> np.ndarray:
    """Points whose value is greater than that of each of their K nearest neighbours, themselves left out.

    Args:
        tree: over N distinct points.
        values: (N,), at the points in the tree's order.
        neighbours: K; all other points where there are fewer.

    Returns:
        Ascending indices of the maxima, int64.
    """
    maxima = np.arange(tree.n)
    for count in (min(FIRST_LOOK, neighbours), neighbours):
        count = min(count, tree.n - 1)
        if not count or not len(maxima):
            break
        _, nearest = tree.query(tree.data[maxima], k=np.arange(2, count + 2))
        maxima = maxima[(values[maxima, None] > values[nearest]).all(1)]
    return maxima


def pair_planes(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The plane between each pair v, m of (P, 3) points: n = (v − m) / |v − m| through (v + m) / 2.

    Returns:
        Unit normals and points, (P (P − 1) / 2, 3) each, in the order of (0, 1), (0, 2), ..., (1, 2), ...
    """
    first, second = np.triu_indices(len(points), k=1)
    differences = points[first] - points[second]
    return differences / np.linalg.norm(differences, axis=1, keepdims=True), (points[first] + points[second]) / 2
