"""§2.1 From a curve to a cylinder or cone, and its true mirror planes."""

from dataclasses import dataclass

import numpy as np

from symshrec.benchmark.config import BenchmarkConfig
from symshrec.benchmark.curves import draw_curve
from symshrec.benchmark.ranges import uniform_in
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
    height = uniform_in(rng, surface.height)
    count = surface.citrus_points if family == "citrus" else surface.points
    section = curve.sample(count, rng, config.curves.sampling)
    shares = rng.random(count)
    points = np.empty((count, 3))
    points[:, :2] = section if solid == "cylinder" else section * shares[:, None]
    points[:, 2] = height * shares - height / 2
    planes = true_planes(curve.mirror_angles, solid)
    return Shape(points, 1 / section.max(), planes, solid, {**curve.parameters, "height": height})
