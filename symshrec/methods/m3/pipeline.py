"""§3.3 Diffusion-based symmetry detection [SGS14 for point clouds]: one cloud in, its mirror planes out."""

import numpy as np

from symshrec.geometry.straight import is_straight
from symshrec.geometry.trees import midpoint_tree
from symshrec.methods.m3.candidates import local_maxima, pair_planes
from symshrec.methods.m3.selection import select_planes
from symshrec.methods.m3.settings import M3Settings
from symshrec.methods.m3.spectrum import diffusion, laplacian_spectrum
from symshrec.planes import Planes

FEWEST_POINTS = 4


def detect_planes(points: np.ndarray, settings: M3Settings | None = None) -> Planes:
    """The mirror planes of one cloud, by descending confidence 1 − chamfer / chamfer_limit, in (0, 1].

    The order of the points changes nothing. The planes turn with the cloud, but for what `spatial_order` says of the
    Laplacian, and confidences change with the diagonal of the bounding box, which is not the same for a turned cloud.

    Args:
        points: (N, 3) in any unit. Coincident points count once; fewer than four distinct points or points on a
            straight line have no planes to give, and a cloud of fewer points than `neighbours` seldom has.
        settings: the published ones where omitted.

    Returns:
        Planes in the coordinates of the points, normals over `separation_deg` from each other.

    Raises:
        ValueError: for a wrong shape or values that are not finite.
        RuntimeError: where the Laplacian has no spectrum.
    """
    settings = settings or M3Settings()
    return detect_diffused(points, (settings, diffused(points, settings)))


def diffused(points: np.ndarray, settings: M3Settings) -> np.ndarray:
    """The diffusion function S on the distinct points of a cloud (N, 3), in spatial order; empty where there are no
    planes to find. It depends on the settings of the Laplacian and of the diffusion alone; errors as `detect_planes`.
    """
    cloud, _, _ = _normalised(points)
    if not len(cloud):
        return np.empty(0)
    spectrum = laplacian_spectrum(cloud, settings.eigenpairs, settings.mollify, settings.laplacian_neighbours)
    return diffusion(*spectrum, settings.time_factor)


def detect_diffused(points: np.ndarray, known: tuple[M3Settings, np.ndarray]) -> Planes:
    """`detect_planes` where `diffused` has been computed: steps 2 and 3 with these settings and values."""
    cloud, diagonal, centre = _normalised(points)
    if not len(cloud):
        return Planes.empty()
    return _detect(cloud, *known).transformed(scale=diagonal, translation=centre)


def _normalised(points: np.ndarray) -> tuple[np.ndarray, float, np.ndarray]:
    """The distinct points at diagonal 1 around the box's centre, in spatial order, none where there are no planes to
    find; the diagonal and the centre."""
    points = np.asarray(points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3:
        raise ValueError(f"points have shape {points.shape}, expected (N, 3)")
    if not np.isfinite(points).all():
        raise ValueError(f"point {int(np.argwhere(~np.isfinite(points))[0, 0])} is not finite")
    none = np.empty((0, 3)), 0.0, np.zeros(3)
    if len(points) < FEWEST_POINTS:
        return none
    centre = (points.min(0) + points.max(0)) / 2
    diagonal = float(np.linalg.norm(np.ptp(points, axis=0)))
    if diagonal == 0:
        return none
    cloud = spatial_order((points - centre) / diagonal)
    if len(cloud) < FEWEST_POINTS or is_straight(cloud):
        return none
    return cloud, diagonal, centre


def spatial_order(points: np.ndarray) -> np.ndarray:
    """The distinct ones of (N, 3) points in an order that depends on their places alone, near ones near each other.

    The robust Laplacian depends on the order of its points, by up to .1 % of an eigenvalue: enough for another sample
    point to become the local maximum. In this order the same cloud always has the same planes, and queries are faster.
    """
    points = points[np.lexsort(points.T)]
    repeated = (np.diff(points, axis=0) == 0).all(1)
    points = points[np.concatenate([[True], ~repeated])]
    return points[midpoint_tree(points).indices]


def _detect(cloud: np.ndarray, settings: M3Settings, values: np.ndarray) -> Planes:
    tree = midpoint_tree(cloud)
    normals, origins = pair_planes(cloud[local_maxima(tree, values, settings.neighbours)])
    kept, distances = select_planes(tree, normals, origins, settings.chamfer_limit, settings.separation_deg)
    return Planes(normals[kept], origins[kept], 1 - distances / settings.chamfer_limit)
