"""A shape made symmetric: the average of it and its images under a group."""

import numpy as np
from scipy.spatial import cKDTree

from symshrec.geometry.surfaces import DiscSurface
from symshrec.geometry.triangles import MeshSurface

ROUNDS = 3  # each halves what is left where a point's image has no partner of its own
PAIRED = 0.9  # share of the points with a partner from which a shape's points are taken to be pairs
CLOSE = 0.5  # of the distance to the next point, within which a partner lies


def symmetrised(
    points: np.ndarray, transforms: np.ndarray, triangles: np.ndarray | None = None, rounds: int = ROUNDS
) -> np.ndarray:
    """A cloud's points, or a mesh's vertices, moved to the average of the shape and its images: (N, 3).

    Of every point, each image under the group looks for its place on the shape, which is brought back; the point moves
    to the mean of all of these. The place is the image's partner where nearly all points have one (both the nearest of
    each other, and close), as a mesh that was modelled in halves and then bent; else the nearest place on the surface:
    on the triangles of a mesh, on the discs through neighbours of a cloud. Points stay as many, in their order.

    Args:
        points: (N ≥ 1, 3). triangles: (F, 3), places among them; None for a cloud.
        transforms: (G, 4, 4), all elements of the group, as `PointGroup.transforms`, or the identity and one mirror.

    >>> pair = np.array([[1.0, 0, 0], [-1.5, 0, 0.5]])
    >>> symmetrised(pair, np.stack([np.eye(4), np.diag([-1.0, 1, 1, 1])])).tolist()
    [[1.25, 0.0, 0.25], [-1.25, 0.0, 0.25]]
    """
    points, places = np.unique(np.asarray(points, dtype=np.float64), axis=0, return_inverse=True)
    triangles = None if triangles is None else places[triangles]
    return _averaged(points, transforms, triangles, rounds)[places]


def _averaged(points: np.ndarray, transforms: np.ndarray, triangles: np.ndarray | None, rounds: int) -> np.ndarray:
    """The same of distinct points."""
    centre = points.mean(axis=0)
    points = points - centre
    turns = transforms[:, :3, :3]
    shifts = transforms[:, :3, 3] + turns @ centre - centre
    for _ in range(rounds):
        paired = True
        surface = DiscSurface(points) if triangles is None else MeshSurface(points, triangles)
        tree, total = cKDTree(points), np.zeros_like(points)
        spacing = tree.query(points, k=2)[0][:, 1] if len(points) > 1 else np.zeros(1)
        for turn, shift in zip(turns, shifts, strict=True):
            images = points @ turn.T + shift
            partner, has = _partners(tree, images, spacing)
            places = points[partner]
            if has.mean() < PAIRED:
                paired, places = False, surface.closest(images)[0]
            elif not has.all():
                places[~has] = surface.closest(images[~has])[0]
            total += (places - shift) @ turn  # the inverse: turns are orthogonal
        points = total / len(turns)
        if paired:
            break
    return points + centre


def _partners(tree: cKDTree, images: np.ndarray, spacing: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Every image's nearest point (N,), and whether it is its partner: (N,) bool."""
    distances, nearest = tree.query(images)
    back = cKDTree(images).query(tree.data)[1]
    return nearest, (back[nearest] == np.arange(len(images))) & (distances <= CLOSE * spacing[nearest])
