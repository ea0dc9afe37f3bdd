"""How well a plane mirrors a cloud onto itself, whichever method found it: the residual that people are shown."""

import numpy as np
from scipy.spatial import cKDTree

from symshrec.planes import Planes

POINTS = 20_000  # of a larger cloud, drawn at random, that are mirrored and mirrored onto
NEIGHBOURS = 12  # points that stand for the surface around one of them


def mirror_residuals(points: np.ndarray, planes: Planes, limit: int = POINTS, seed: int = 0) -> np.ndarray:
    """Mean distance from the mirrored points to the surface that the points lie on, (K,), in their unit.

    The surface near a point is the disc that its nearest distinct neighbours span: a mirrored point's distance is that
    to the disc of the point nearest to it, or to that point where it is nearer. So what is measured is the mismatch of
    the two surfaces, noise included, and hardly the gaps between points: an exact plane of a clean box has about 0.

    Args:
        points: (N ≥ 1, 3), finite, any unit and position.
        limit: of points used; more are thinned at random by `seed`.

    Raises:
        ValueError: for another shape.

    >>> square = np.stack(np.meshgrid(np.arange(9), np.arange(9), [0]), -1).reshape(-1, 3)
    >>> right, wrong = mirror_residuals(square, Planes([[1, 0, 0], [1, 0, 1]], [[4, 0, 0], [4, 0, 0]]))
    >>> bool(right < 1e-9), bool(wrong > 1)
    (True, True)
    """
    points = np.asarray(points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3 or not len(points):
        raise ValueError(f"points have shape {points.shape}, expected (N, 3) with N ≥ 1")
    if not len(planes):
        return np.zeros(0)
    if len(points) > limit:
        points = points[np.random.default_rng(seed).choice(len(points), limit, replace=False)]
    centre = points.mean(axis=0)
    points, planes = points - centre, planes.transformed(translation=-centre)
    tree = cKDTree(np.unique(points, axis=0))
    centres, normals, radii = _discs(tree)
    residuals = np.empty(len(planes))
    for row in range(len(planes)):
        mirrored = planes[row].mirror(points)[0]
        distances, nearest = tree.query(mirrored)
        offsets = mirrored - centres[nearest]
        heights = np.einsum("nd,nd->n", offsets, normals[nearest])
        beside = np.linalg.norm(offsets - heights[:, None] * normals[nearest], axis=1) - radii[nearest]
        residuals[row] = np.minimum(np.hypot(heights, np.maximum(beside, 0)), distances).mean()
    return residuals


def _discs(tree: cKDTree) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Around every point, the disc through its neighbours: centres (N, 3), unit normals (N, 3), radii (N,)."""
    count = min(NEIGHBOURS, tree.n)
    neighbours = tree.data[tree.query(tree.data, k=np.arange(1, count + 1))[1]]  # (N, k, 3)
    centres = neighbours.mean(axis=1)
    offsets = neighbours - centres[:, None]
    normals = np.linalg.eigh(np.einsum("nki,nkj->nij", offsets, offsets))[1][:, :, 0]
    heights = np.einsum("nki,ni->nk", offsets, normals)
    radii = np.sqrt(np.maximum(np.square(offsets).sum(axis=2) - heights**2, 0)).max(axis=1)
    return centres, normals, radii
