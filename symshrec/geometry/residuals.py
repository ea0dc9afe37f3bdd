"""How well a plane mirrors a cloud onto itself, whichever method found it: residual, asymmetry, point by point.

The surface near a point is the disc that its nearest distinct neighbours span: a mirrored point's distance is that to
the disc of the point nearest to it, or to that point where it is nearer. So what is measured is the mismatch of the two
surfaces, noise included, and hardly the gaps between points.
"""

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from symshrec.geometry.surfaces import DiscSurface
from symshrec.geometry.triangles import MeshSurface
from symshrec.planes import Planes

POINTS = 20_000  # of a larger cloud, drawn at random, that are mirrored and mirrored onto


class Mismatch(NamedTuple):
    """Of K planes: mean distance of the mirrored points from the surface, (K,) in their unit, and asymmetry, (K,)."""

    residuals: np.ndarray
    asymmetries: np.ndarray


def mirror_residuals(points: np.ndarray, planes: Planes, limit: int = POINTS, seed: int = 0) -> np.ndarray:
    """Mean distance from the mirrored points to the surface that the points lie on, (K,), in their unit.

    An exact plane of a clean box has about 0.

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
    return mismatch(points, planes, limit, seed).residuals


def asymmetry(points: np.ndarray, planes: Planes, limit: int = POINTS, seed: int = 0) -> np.ndarray:
    """The asymmetry index of a cloud to each plane, (K,), without unit: 0 for perfect.

    The root mean square distance from the mirrored points to the surface that the points lie on, divided by the
    diagonal of the cloud's axis-aligned box. 0 where every point has its mirror image; where images fall between
    points, sampling leaves what the surface curves by between neighbours.

    Args, Raises: as `mirror_residuals`.

    >>> sheets = np.array([[x, y, 3.0 * (x > 0)] for x in (-4, -3, -2, 2, 3, 4) for y in range(9)])
    >>> asymmetry(sheets, Planes([[1, 0, 0], [0, 1, 0]], [[0, 0, 0], [0, 4, 0]])).round(3).tolist()
    [0.256, 0.0]
    """
    return mismatch(points, planes, limit, seed).asymmetries


def mismatch(
    points: np.ndarray, planes: Planes, limit: int = POINTS, seed: int = 0, mesh: MeshSurface | None = None
) -> Mismatch:
    """Residuals and asymmetries, as `mirror_residuals` and `asymmetry`; from the mesh that the points are of, if any.

    >>> mismatch(np.eye(3), Planes.empty())
    Mismatch(residuals=array([], dtype=float64), asymmetries=array([], dtype=float64))
    """
    points = _checked(points)
    if not len(planes):
        return Mismatch(np.zeros(0), np.zeros(0))
    diagonal = np.linalg.norm(np.ptp(points, axis=0))
    if len(points) > limit:
        points = points[np.random.default_rng(seed).choice(len(points), limit, replace=False)]
    centre = points.mean(axis=0)
    points, planes = points - centre, planes.transformed(translation=-centre)
    surface = DiscSurface(points) if mesh is None else mesh.moved(-centre)
    distances = [surface.closest(planes[row].mirror(points)[0])[1] for row in range(len(planes))]
    means = np.array([each.mean() for each in distances])
    roots = np.array([np.sqrt(np.square(each).mean()) for each in distances])
    return Mismatch(means, roots / max(diagonal, np.finfo(float).tiny))


def mirror_deviations(points: np.ndarray, planes: Planes, mesh: MeshSurface | None = None) -> np.ndarray:
    """How far every point is from the mirror image of the cloud's surface: (K, N) signed, in the points' unit.

    Positive where the point stands outside of the mirrored surface (there is more here than on the other side), and
    negative where it lies inside. Which side is outside is told by the points alone, as `DiscSurface.signed` does.

    Args:
        points: (N ≥ 1, 3), finite, any unit and position; all are used.
        mesh: that the points are of; distances are then from its triangles.

    Raises:
        ValueError: for another shape.

    >>> x, y = (grid.ravel() for grid in np.meshgrid(np.r_[-9:-1, 2:10], np.arange(9)))
    >>> table = np.stack([x, y, 0.5 * (x > 0)], 1)
    >>> left, right = (mirror_deviations(table, Planes([[1, 0, 0]], [[0, 0, 0]]))[0][side] for side in (x < 0, x > 0))
    >>> float(np.abs(left).round(9).max()), float(np.abs(right).round(9).max())
    (0.5, 0.5)
    """
    points = _checked(points)
    centre = points.mean(axis=0)
    points, planes = points - centre, planes.transformed(translation=-centre)
    surface, exact = DiscSurface(points), None if mesh is None else mesh.moved(-centre)
    deviations = np.empty((len(planes), len(points)))
    for row, image in enumerate(planes.mirror(points)):
        deviations[row] = surface.signed(image)
        if exact is not None:
            deviations[row] = np.copysign(exact.closest(image)[1], deviations[row])
    return deviations


def mirror_correspondences(points: np.ndarray, planes: Planes) -> tuple[np.ndarray, np.ndarray]:
    """Which point every point's mirror image is nearest to.

    Args:
        points: (N ≥ 1, 3), finite, any unit and position.

    Returns:
        Places among the points (K, N) int64, and the distances (K, N) from the mirror images, in the points' unit.

    Raises:
        ValueError: for another shape.

    >>> points = np.array([[1.0, 0, 0], [-1.25, 0, 0], [5, 5, 5]])
    >>> partners, distances = mirror_correspondences(points, Planes([[1, 0, 0]], [[0, 0, 0]]))
    >>> partners[:, :2].tolist(), distances[:, :2].tolist()
    ([[1, 0]], [[0.25, 0.25]])
    """
    points = _checked(points)
    tree = cKDTree(points)
    found = [tree.query(image) for image in planes.mirror(points)]
    distances = np.array([each for each, _ in found]).reshape(len(planes), len(points))
    return np.array([each for _, each in found], dtype=np.int64).reshape(distances.shape), distances


def _checked(points: np.ndarray) -> np.ndarray:
    points = np.asarray(points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3 or not len(points):
        raise ValueError(f"points have shape {points.shape}, expected (N, 3) with N ≥ 1")
    return points
