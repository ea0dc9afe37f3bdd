"""§2.1 Where a surface is put: rotations and translations, drawn from the configured group."""

from dataclasses import dataclass

import numpy as np

from symshrec.benchmark.config import PoseConfig, PoseGroup
from symshrec.geometry.rotations import axis_rotation, uniform_rotation


@dataclass(frozen=True, eq=False)
class Pose:
    """x ↦ rotation x + translation; rotation (3, 3), translation (3,)."""

    rotation: np.ndarray
    translation: np.ndarray

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """Moved copies of points (N, 3)."""
        moved = points @ self.rotation.T
        for coordinate, shift in zip(moved.T, self.translation, strict=True):
            coordinate += shift
        return moved


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
