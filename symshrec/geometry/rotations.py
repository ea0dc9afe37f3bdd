"""Rotation matrices from quaternions, of arrays and tensors alike, and about an axis."""

import sys

import numpy as np


def rotation_matrices(quaternions):
    """Rotation matrices (..., 3, 3) of unit quaternions (..., 4), the real part first.

    Args:
        quaternions: a NumPy array or a torch tensor, on any device; the matrices are of its kind and type.

    Raises:
        ValueError: for another last axis than 4.

    >>> rotation_matrices(np.array([0.0, 0, 0, 1])).tolist()  # half a turn about z
    [[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]]
    """
    if quaternions.ndim < 1 or quaternions.shape[-1] != 4:
        raise ValueError(f"quaternions have shape {tuple(quaternions.shape)}, expected (..., 4)")
    w, x, y, z = (quaternions[..., part] for part in range(4))
    entries = (
        *(1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        *(2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        *(2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    library = sys.modules[type(quaternions).__module__.partition(".")[0]]  # numpy or torch, imported by whoever has one
    return library.stack(entries, -1).reshape(*quaternions.shape[:-1], 3, 3)


def axis_rotation(axis: int, angle: float) -> np.ndarray:
    """Rotation (3, 3) by `angle` radians about coordinate axis 0, 1 or 2.

    >>> (axis_rotation(2, np.pi / 2) @ [1, 0, 0]).round(12).tolist()
    [0.0, 1.0, 0.0]
    """
    rotation = np.eye(3)
    first, second = (axis + 1) % 3, (axis + 2) % 3
    rotation[[first, second], [first, second]] = np.cos(angle)
    rotation[second, first], rotation[first, second] = np.sin(angle), -np.sin(angle)
    return rotation


def uniform_rotation(rng: np.random.Generator) -> np.ndarray:
    """A rotation (3, 3) drawn uniformly over SO(3), from a uniform unit quaternion.

    >>> rotation = uniform_rotation(np.random.default_rng(0))
    >>> np.allclose(rotation @ rotation.T, np.eye(3)), bool(np.linalg.det(rotation) > 0)
    (True, True)
    """
    quaternion = rng.standard_normal(4)
    return rotation_matrices(quaternion / np.linalg.norm(quaternion))
