"""A shape put upright by its planes: the first to x = 0, the second to y = 0."""

from itertools import product

import numpy as np

from symshrec.planes import Planes, axis_angles

APART_DEG = 5.0  # least angle between the first plane and a second
UPRIGHT_DEG = 5.0  # least angle between the line that two planes share and a third


def aligning_transform(planes: Planes, middle: np.ndarray) -> np.ndarray:
    """The rigid transform (4, 4) that brings the first plane to x = 0 and the second to y = 0.

    The second is the next that is at least 5° from the first: where it is not perpendicular, the line that both share
    comes to x = y = 0. A third that crosses this line brings their common point to z = 0. What no plane holds comes
    from `middle`, which goes to 0 there, and the turn is the least of those that can be.

    Args:
        planes: K ≥ 1, the first first. middle: (3,), of the shape, such as its centroid.

    Raises:
        ValueError: without a plane.

    >>> aligning_transform(Planes([[1, 0, 0]], [[5, 0, 0]]), np.array([1.0, 2, 3])).tolist()
    [[1.0, 0.0, 0.0, -5.0], [0.0, 1.0, 0.0, -2.0], [0.0, 0.0, 1.0, -3.0], [0.0, 0.0, 0.0, 1.0]]
    """
    if not len(planes):
        raise ValueError("there is no plane to align by")
    normals, angles = planes.normals, axis_angles(planes.normals[:1], planes.normals)[0]
    others = np.flatnonzero(angles >= np.radians(APART_DEG))
    x = normals[0]
    held = [0]
    if len(others):
        held.append(int(others[0]))
        z = np.cross(x, normals[others[0]])
        z /= np.linalg.norm(z)
        crossing = [row for row in others[1:] if abs(normals[row] @ z) > np.sin(np.radians(UPRIGHT_DEG))]
        held += [int(row) for row in crossing[:1]]
    else:
        z = np.eye(3)[max(range(3), key=lambda axis: (-round(abs(x[axis]), 9), axis))]  # most across x, else the later
        z = z - (z @ x) * x
        z /= np.linalg.norm(z)
    frame = np.stack([x, np.cross(z, x), z])
    choices = [np.diag([a, b, a * b]) @ frame for a, b in product((1.0, -1.0), repeat=2)]
    rotation = max(choices, key=np.trace)
    heights = np.einsum("kd,kd->k", normals[held], planes.points[held] - middle)
    origin = middle + np.linalg.lstsq(normals[held], heights, rcond=1e-6)[0]
    transform = np.eye(4)
    transform[:3, :3], transform[:3, 3] = rotation + 0.0, -rotation @ origin + 0.0
    return transform
