"""§2.1 Where a shape lies: rotations and translations of the whole of it."""

from dataclasses import dataclass

import numpy as np

from symshrec.benchmark.config import PoseConfig, PoseGroup


@dataclass(frozen=True, eq=False)
class Pose:
    """x ↦ rotation x + translation; rotation (3, 3), translation (3,)."""

    rotation: np.ndarray
    translation: np.ndarray

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """Moved copies of points (N, 3)."""
        return points @ self.rotation.T + self.translation


def axis_rotation(axis: int, angle: float) -> np.ndarray:
    """Rotation by `angle` radians about coordinate axis 0, 1 or 2: (3, 3)."""
    rotation = np.eye(3)
    first, second = (axis + 1) % 3, (axis + 2) % 3
    rotation[[first, second], [first, second]] = np.cos(angle)
    rotation[second, first], rotation[first, second] = np.sin(angle), -np.sin(angle)
    return rotation


def uniform_rotation(rng: np.random.Generator) -> np.ndarray:
    """A rotation uniform over SO(3), (3, 3), from a uniform unit quaternion."""
    quaternion = rng.standard_normal(4)
    w, x, y, z = quaternion / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def draw_pose(rng: np.random.Generator, config: PoseConfig) -> Pose:
    """A pose from the configured group; angles in whole degrees of [−180, 180) where asked."""
    rotation, translation = np.eye(3), np.zeros(3)
    if config.group is PoseGroup.none:
        return Pose(rotation, translation)
    if config.group is PoseGroup.so3:
        return Pose(uniform_rotation(rng), rng.uniform(-config.translation, config.translation, 3))
    for axis in (0, 1) if config.group is PoseGroup.xy_axes else (0,):
        if rng.random() < config.rotation_probability:
            degrees = rng.integers(-180, 180) if config.whole_degrees else rng.uniform(-180, 180)
            rotation = axis_rotation(axis, np.deg2rad(degrees)) @ rotation
    if rng.random() < config.translation_probability:
        translation = rng.uniform(-config.translation, config.translation, 3)
    return Pose(rotation, translation)
