"""§2.1 From a curve to a cylinder or cone with its true mirror planes, as a chart that gives points and normals."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from symshrec.benchmark.config import BenchmarkConfig, CurveSampling
from symshrec.benchmark.curves import Curve, draw_curve
from symshrec.benchmark.ranges import uniform_in
from symshrec.planes import Planes

STEP = 1e-5  # in chart coordinates, of the differences that give tangents


class Surface(ABC):
    """A surface as a chart: from places on it, coordinates (N, C) of which the first two vary smoothly, to points.

    bounds: the ranges of those two, beyond which there is no surface.
    """

    bounds: tuple[tuple[float, float], tuple[float, float]]

    @abstractmethod
    def draw(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """Random places, (count, C), spread as the benchmark's points are."""

    @abstractmethod
    def points(self, chart: np.ndarray) -> np.ndarray:
        """The points (N, 3) at places (N, C)."""

    def normals(self, chart: np.ndarray) -> np.ndarray:
        """Unit normals (N, 3) at places (N, C), of either sign; zero where there is no tangent plane."""
        tangents = []
        for column, bounds in enumerate(self.bounds):
            before, after = chart.copy(), chart.copy()
            before[:, column] = np.clip(chart[:, column] - STEP, *bounds)
            after[:, column] = np.clip(chart[:, column] + STEP, *bounds)
            tangents.append(_unit(self.points(after) - self.points(before)))
        along_first, along_second = tangents
        return _unit(np.cross(along_first, along_second))


@dataclass(frozen=True, eq=False)
class Extrusion(Surface):
    """A cylinder or cone over a curve; a place is (u, share of the height from below, branch of the curve).

    Cylinder (x, y, z); cone (s x, s y, z) with the apex at −h/2 and the full curve at +h/2; z = h s − h/2, no caps.
    """

    curve: Curve
    solid: str
    height: float
    sampling: CurveSampling

    @property
    def bounds(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Of u and of the share."""
        return self.curve.domain, (0.0, 1.0)

    def draw(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """Places (count, 3): u as the configured sampling has it, heights uniform."""
        u, branch = self.curve.draw(count, rng, self.sampling)
        return np.stack([u, rng.random(count), branch], axis=1)

    def section(self, chart: np.ndarray) -> np.ndarray:
        """The curve's points (N, 2) below or above the places."""
        return self.curve.at(chart[:, 0], chart[:, 2])

    def points(self, chart: np.ndarray) -> np.ndarray:
        """The points (N, 3) at places (N, 3)."""
        return self.raised(self.section(chart), chart[:, 1])

    def raised(self, section: np.ndarray, shares: np.ndarray) -> np.ndarray:
        """The points (N, 3) over the curve's points (N, 2), at these shares (N,) of the height."""
        points = np.empty((len(section), 3))
        for on_curve, raised in zip(section.T, points.T[:2], strict=True):
            raised[:] = on_curve if self.solid == "cylinder" else on_curve * shares
        points[:, 2] = self.height * shares - self.height / 2
        return points


@dataclass(frozen=True, eq=False)
class Moved(Surface):
    """The surface under x ↦ linear x + translation; linear (3, 3) of any non-zero determinant, translation (3,)."""

    surface: Surface
    linear: np.ndarray
    translation: np.ndarray

    def draw(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """Places as on the surface that is moved."""
        return self.surface.draw(count, rng)

    def points(self, chart: np.ndarray) -> np.ndarray:
        """The points (N, 3) at places (N, C)."""
        return self.surface.points(chart) @ self.linear.T + self.translation

    def normals(self, chart: np.ndarray) -> np.ndarray:
        """Unit normals (N, 3) at places (N, C)."""
        return _unit(self.surface.normals(chart) @ np.linalg.inv(self.linear))


@dataclass(frozen=True, eq=False)
class Shape:
    """A surface in its own frame, the local origin half-way up, with the places on it that become the cloud.

    chart (N, C): those places; points (N, 3): the surface's there. unit_factor: what scales x and y to the unit size.
    planes: the true planes, all through the local origin; scaling x and y alike leaves them where they are.
    """

    surface: Surface
    chart: np.ndarray
    points: np.ndarray
    unit_factor: float
    planes: Planes
    solid: str
    parameters: dict[str, float]


@lru_cache(maxsize=64)
def true_planes(mirror_angles: tuple[float, ...], solid: str) -> Planes:
    """Mirror planes of the surface over a curve with these mirror lines: as many, and z = 0 for a cylinder.

    Their arrays are not to be changed: the next cloud with the same lines has them too.
    """
    angles = np.array(mirror_angles)
    normals = np.stack([-np.sin(angles), np.cos(angles), np.zeros_like(angles)], axis=1)
    if solid == "cylinder":
        normals = np.concatenate([normals, [[0.0, 0.0, 1.0]]])
    planes = Planes(normals, np.zeros_like(normals))
    planes.normals.setflags(write=False)
    planes.points.setflags(write=False)
    return planes


def draw_shape(family: str, rng: np.random.Generator, config: BenchmarkConfig) -> Shape:
    """A cylinder or cone over a curve of the family, heights uniform along the axis.

    Raises:
        ValueError: for a family that Table 1 does not have, naming those it has.
    """
    curve = draw_curve(family, rng, config.curves)
    solid = "cylinder" if rng.random() < config.surface.cylinder_probability else "cone"
    surface = Extrusion(curve, solid, uniform_in(rng, config.surface.height), config.curves.sampling)
    count = config.surface.citrus_points if family == "citrus" else config.surface.points
    chart = surface.draw(count, rng)
    parameters = {**curve.parameters, "height": surface.height}
    planes = true_planes(tuple(curve.mirror_angles), solid)
    section = surface.section(chart)
    points = surface.raised(section, chart[:, 1])
    return Shape(surface, chart, points, 1 / section.max(), planes, solid, parameters)


def _unit(vectors: np.ndarray) -> np.ndarray:
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.divide(vectors, lengths, out=np.zeros_like(vectors), where=lengths > 0)
