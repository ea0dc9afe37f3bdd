"""Beyond the paper: shapes without any mirror plane, on which every plane that a method finds is a false one."""

import math
from dataclasses import dataclass

import numpy as np

from symshrec.benchmark.cloud import FAMILIES, PLANELESS_SOLIDS
from symshrec.benchmark.config import BenchmarkConfig
from symshrec.benchmark.curves import draw_curve
from symshrec.benchmark.ranges import uniform_in, whole_in
from symshrec.benchmark.surfaces import Extrusion, Moved, Shape, Surface
from symshrec.geometry.rotations import axis_rotation
from symshrec.planes import Planes

# Leaning takes every plane from a curve of few mirror lines, since of many some lie near the direction of the lean, and
# that is not flat (least extent beside the greatest), since it hardly changes what a flat shape's own plane mirrors.
FEW_LINES = 4
ROUND = 0.5
WIDTH = 2.0  # about that of a unit-sized shape


def draw_planeless(rng: np.random.Generator, config: BenchmarkConfig) -> Shape:
    """A sheared, a glued or a blob, with equal chances."""
    kind = PLANELESS_SOLIDS[rng.integers(len(PLANELESS_SOLIDS))]
    surface, parameters = KINDS[kind](rng, config)
    chart = surface.draw(config.surface.points, rng)
    return Shape(surface, chart, surface.points(chart), 1.0, Planes.empty(), kind, parameters)


def sheared(rng: np.random.Generator, config: BenchmarkConfig) -> tuple[Surface, dict[str, float]]:
    """A cylinder or cone that leans half-way between two mirror lines of its curve.

    A mirror plane of it would be the image of one of the upright shape, and the lean tilts the images of all of them
    against the planes across their own normals.
    """
    while True:
        upright, parameters = _extrusion(rng, config, uniform_in(rng, config.surface.height))
        if len(upright.curve.mirror_angles) <= FEW_LINES and _roundness(upright) >= ROUND:
            break
    shear, way = uniform_in(rng, config.planeless.shear), _between(upright)
    leaning = np.eye(3)
    leaning[:2, 2] = shear * max(1.0, WIDTH / upright.height) * np.array([np.cos(way), np.sin(way)])
    return Moved(_unit_sized(upright), leaning, np.zeros(3)), parameters | {"height": upright.height, "shear": shear}


def glued(rng: np.random.Generator, config: BenchmarkConfig) -> tuple[Surface, dict[str, float]]:
    """Halves over curves of two families, one on the other, their axes apart.

    Only the plane through both axes could mirror both halves, and it lies half-way between mirror lines of each.
    """
    height, offset = uniform_in(rng, config.surface.height), uniform_in(rng, config.planeless.offset)
    first, second = rng.choice(len(FAMILIES), 2, replace=False)
    halves, parameters = [], {"height": height, "offset": offset}
    for number, sign in ((first, -1), (second, 1)):
        half, drawn = _extrusion(rng, config, height / 2, FAMILIES[number])
        turned = axis_rotation(2, -_between(half))
        halves.append(Moved(_unit_sized(half), turned, np.array([sign * offset / 2, 0, sign * height / 4])))
        parameters |= {f"{name}_{'below' if sign < 0 else 'above'}": value for name, value in drawn.items()}
    return Together(*halves), parameters


def blob(rng: np.random.Generator, config: BenchmarkConfig) -> tuple[Surface, dict[str, float]]:
    """A closed smooth surface about the origin: a sphere with random bumps and dents."""
    choices = config.planeless
    count = whole_in(rng, choices.bumps)
    centres = rng.standard_normal((count, 3))
    centres /= np.linalg.norm(centres, axis=1, keepdims=True)
    heights = rng.uniform(choices.bump_height[0], choices.bump_height[1], count) * rng.choice([-1.0, 1.0], count)
    widths = np.deg2rad(rng.uniform(choices.bump_width_deg[0], choices.bump_width_deg[1], count))
    return Blob(centres, heights, widths), {"bumps": float(count)}


KINDS = dict(zip(PLANELESS_SOLIDS, (sheared, glued, blob), strict=True))


@dataclass(frozen=True, eq=False)
class Together(Surface):
    """Two surfaces as one; a place is one on either of them, followed by 0 for the first and 1 for the second."""

    first: Surface
    second: Surface

    def draw(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """As many places on each, the first one's first."""
        parts = [self.first.draw(count - count // 2, rng), self.second.draw(count // 2, rng)]
        return np.concatenate([np.column_stack([part, np.full(len(part), float(n))]) for n, part in enumerate(parts)])

    def points(self, chart: np.ndarray) -> np.ndarray:
        """The points (N, 3) at places (N, C)."""
        return self._each(chart, "points")

    def normals(self, chart: np.ndarray) -> np.ndarray:
        """Unit normals (N, 3) at places (N, C)."""
        return self._each(chart, "normals")

    def _each(self, chart: np.ndarray, what: str) -> np.ndarray:
        values = np.empty((len(chart), 3))
        for number, surface in enumerate((self.first, self.second)):
            rows = chart[:, -1] == number
            values[rows] = getattr(surface, what)(chart[rows, :-1])
        return values


@dataclass(frozen=True, eq=False)
class Blob(Surface):
    """The unit sphere with log-radius Σ heightₖ exp((cos αₖ − 1) / widthₖ²), αₖ the angle from centre k.

    A place is (longitude, z of the direction). centres (K, 3) unit vectors, heights (K,), widths (K,) in radians.
    """

    centres: np.ndarray
    heights: np.ndarray
    widths: np.ndarray
    bounds = ((-np.inf, np.inf), (-1.0, 1.0))

    def draw(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """Places (count, 2) whose directions are uniform on the sphere."""
        return np.column_stack([rng.uniform(-np.pi, np.pi, count), rng.uniform(-1, 1, count)])

    def points(self, chart: np.ndarray) -> np.ndarray:
        """The points (N, 3) at places (N, 2)."""
        longitudes, z = chart.T
        across = np.sqrt(1 - z * z)
        directions = np.stack([across * np.cos(longitudes), across * np.sin(longitudes), z], axis=1)
        cosines = np.einsum("nd,kd->nk", directions, self.centres)
        radii = _exp((self.heights * _exp((cosines - 1) / self.widths**2)).sum(axis=1))
        return radii[:, None] * directions


def _exp(values: np.ndarray) -> np.ndarray:
    """The exponential by the C library. NumPy has one of its own where there is AVX-512, with other last digits."""
    return np.array(list(map(math.exp, values.ravel().tolist()))).reshape(values.shape)


def _extrusion(rng, config: BenchmarkConfig, height: float, family: str | None = None) -> tuple[Extrusion, dict]:
    """A cylinder or cone of this height over a curve of the family, or of a random one; and the curve's parameters."""
    curve = draw_curve(family or FAMILIES[rng.integers(len(FAMILIES))], rng, config.curves)
    solid = "cylinder" if rng.random() < config.surface.cylinder_probability else "cone"
    return Extrusion(curve, solid, height, config.curves.sampling), curve.parameters


def _unit_sized(extrusion: Extrusion) -> Moved:
    """With x and y scaled by 1 / their largest value on the curve."""
    u = np.linspace(*extrusion.curve.domain, 2049)
    factor = 1 / extrusion.curve.points(u).max()
    return Moved(extrusion, np.diag([factor, factor, 1.0]), np.zeros(3))


def _roundness(extrusion: Extrusion) -> float:
    """The curve's smaller extent in x or y beside the greater."""
    extents = np.ptp(extrusion.curve.points(np.linspace(*extrusion.curve.domain, 2049)), axis=0)
    return float(extents.min() / extents.max())


def _between(extrusion: Extrusion) -> float:
    """An angle half-way between two neighbouring mirror lines of the curve, in radians."""
    angles = extrusion.curve.mirror_angles
    return float(angles[0] + np.pi / (2 * len(angles)))
