"""§2.1 From a curve to a posed cylinder or cone, and its true mirror planes."""

from dataclasses import dataclass

import numpy as np

from symshrec.benchmark.config import BenchmarkConfig, PoseConfig, PoseGroup
from symshrec.benchmark.curves import draw_curve
from symshrec.planes import Planes


@dataclass(frozen=True, eq=False)
class Shape:
    """A surface in its own frame: the axis along z, the local origin half-way up.

    points (N, 3): x and y as the curve gives them. unit_factor: what scales x and y to the unit size.
    planes: the true planes, all through the local origin; scaling x and y alike leaves them where they are.
    """

    points: np.ndarray
    unit_factor: float
    planes: Planes
    solid: str
    parameters: dict[str, float]


@dataclass(frozen=True, eq=False)
class Pose:
    """x ↦ rotation x + translation; rotation (3, 3), translation (3,)."""

    rotation: np.ndarray
    translation: np.ndarray

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """Moved copies of points (N, 3)."""
        return points @ self.rotation.T + self.translation


def true_planes(mirror_angles: np.ndarray, solid: str) -> Planes:
    """Mirror planes of the surface over a curve with these mirror lines (L,): L, and z = 0 for a cylinder."""
    zeros = np.zeros_like(mirror_angles)
    normals = np.stack([-np.sin(mirror_angles), np.cos(mirror_angles), zeros], axis=1)
    if solid == "cylinder":
        normals = np.concatenate([normals, [[0.0, 0.0, 1.0]]])
    return Planes(normals, np.zeros_like(normals))


def draw_shape(family: str, rng: np.random.Generator, config: BenchmarkConfig) -> Shape:
    """A cylinder or cone over a curve of the family, heights uniform along the axis.

    Cylinder (x, y, z); cone (s x, s y, z) with the apex at −h/2 and the full curve at +h/2; z = h s − h/2, no caps.
    """
    surface = config.surface
    curve = draw_curve(family, rng, config.curves)
    solid = "cylinder" if rng.random() < surface.cylinder_probability else "cone"
    height = rng.uniform(*surface.height)
    count = surface.citrus_points if family == "citrus" else surface.points
    section = curve.sample(count, rng, config.curves.sampling)
    shares = rng.random(count)
    points = np.empty((count, 3))
    points[:, :2] = section if solid == "cylinder" else section * shares[:, None]
    points[:, 2] = height * shares - height / 2
    planes = true_planes(curve.mirror_angles, solid)
    return Shape(points, 1 / section.max(), planes, solid, {**curve.parameters, "height": height})


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
