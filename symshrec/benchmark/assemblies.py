"""Beyond the paper: objects put together of simple parts, such as people scan, with one mirror plane, two, or none."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from symshrec.benchmark.surfaces import Surface
from symshrec.geometry.rotations import axis_rotation, uniform_rotation
from symshrec.planes import Planes

SUNK = 1e-6  # of a part's own size, by which a point must lie inside it to be hidden

Drawn = tuple[np.ndarray, np.ndarray]  # points (N, 3) uniform on a surface, and unit normals (N, 3)


@dataclass(frozen=True, eq=False)
class Solid:
    """A solid about the origin, symmetric about the three coordinate planes, given its half extents (3,).

    draw: count, half extents, rng → that many points on its surface. inside: points (N, 3), half extents → which lie
    inside, (N,). area: half extents → of its surface.
    """

    draw: Callable[[int, np.ndarray, np.random.Generator], Drawn]
    inside: Callable[[np.ndarray, np.ndarray], np.ndarray]
    area: Callable[[np.ndarray], float]


def _box_draw(count: int, half: np.ndarray, rng: np.random.Generator) -> Drawn:
    faces = half[[1, 2, 0]] * half[[2, 0, 1]]  # by the axis across
    axis = rng.choice(3, count, p=faces / faces.sum())
    points = rng.uniform(-1, 1, (count, 3))
    sign = rng.choice([-1.0, 1.0], count)
    rows = np.arange(count)
    points[rows, axis] = sign
    normals = np.zeros((count, 3))
    normals[rows, axis] = sign
    return points * half, normals


def _ellipsoid_draw(count: int, half: np.ndarray, rng: np.random.Generator) -> Drawn:
    kept: list[np.ndarray] = []
    least = half.min()
    while not kept or sum(map(len, kept)) < count:
        ball = rng.standard_normal((2 * count + 8, 3))
        ball /= np.linalg.norm(ball, axis=1, keepdims=True)
        stretch = np.linalg.norm(ball / half, axis=1) * least  # area element beside the greatest
        kept.append(ball[rng.random(len(ball)) < stretch])
    ball = np.concatenate(kept)[:count]
    normals = ball / half
    return ball * half, normals / np.linalg.norm(normals, axis=1, keepdims=True)


def _rim(count: int, half: np.ndarray, rng: np.random.Generator) -> Drawn:
    """Points (count, 2) uniform by length on an ellipse, and its unit normals."""
    angle = np.linspace(0, 2 * np.pi, 721)
    ring = np.stack([half[0] * np.cos(angle), half[1] * np.sin(angle)], 1)
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(ring, axis=0), axis=1))])
    at = np.interp(rng.random(count) * length[-1], length, angle)
    normal = np.stack([np.cos(at) / half[0], np.sin(at) / half[1]], 1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return np.stack([half[0] * np.cos(at), half[1] * np.sin(at)], 1), normal


def _perimeter(half: np.ndarray) -> float:
    a, b = half[:2]
    return float(np.pi * (3 * (a + b) - np.sqrt((3 * a + b) * (a + 3 * b))))  # Ramanujan


def _cylinder_draw(count: int, half: np.ndarray, rng: np.random.Generator) -> Drawn:
    side, cap = 2 * half[2] * _perimeter(half), 2 * np.pi * half[0] * half[1]
    on_side = rng.random(count) < side / (side + cap)
    points, normals = np.zeros((count, 3)), np.zeros((count, 3))
    points[:, :2], normals[:, :2] = _rim(count, half, rng)
    points[:, 2] = rng.uniform(-half[2], half[2], count)
    caps = ~on_side
    angle, radius, sign = rng.uniform(0, 2 * np.pi, count), np.sqrt(rng.random(count)), rng.choice([-1.0, 1.0], count)
    disc = np.stack([radius * half[0] * np.cos(angle), radius * half[1] * np.sin(angle), sign * half[2]], 1)
    points[caps], normals[caps] = disc[caps], np.stack([0 * sign, 0 * sign, sign], 1)[caps]
    return points, normals


def _torus_draw(count: int, half: np.ndarray, rng: np.random.Generator) -> Drawn:
    """A ring about z: tube radius half[2], outer radius half[0]."""
    tube, ring = half[2], half[0] - half[2]
    kept = np.zeros((0, 2))
    while len(kept) < count:
        angles = rng.uniform(0, 2 * np.pi, (2 * count + 8, 2))
        kept = np.vstack([kept, angles[rng.random(len(angles)) * (ring + tube) < ring + tube * np.cos(angles[:, 1])]])
    about, around = kept[:count].T
    normals = np.stack([np.cos(around) * np.cos(about), np.cos(around) * np.sin(about), np.sin(around)], 1)
    spine = ring * np.stack([np.cos(about), np.sin(about), 0 * about], 1)
    return spine + tube * normals, normals


def _torus_inside(points: np.ndarray, half: np.ndarray) -> np.ndarray:
    tube, ring = half[2], half[0] - half[2]
    return np.hypot(np.hypot(points[:, 0], points[:, 1]) - ring, points[:, 2]) < tube


def _ellipsoid_area(half: np.ndarray) -> float:
    """By Thomsen's formula, to 1 %."""
    products = (half * np.roll(half, 1)) ** 1.6075
    return float(4 * np.pi * products.mean() ** (1 / 1.6075))


def _torus_area(half: np.ndarray) -> float:
    return float(4 * np.pi**2 * half[2] * (half[0] - half[2]))


SOLIDS = {
    "box": Solid(
        _box_draw, lambda points, half: (np.abs(points) < half).all(1), lambda half: 8 * float(half @ np.roll(half, 1))
    ),
    "ellipsoid": Solid(_ellipsoid_draw, lambda points, half: np.square(points / half).sum(1) < 1, _ellipsoid_area),
    "cylinder": Solid(
        _cylinder_draw,
        lambda points, half: (np.square(points[:, :2] / half[:2]).sum(1) < 1) & (np.abs(points[:, 2]) < half[2]),
        lambda half: 2 * float(half[2]) * _perimeter(half) + 2 * np.pi * float(half[0] * half[1]),
    ),
    "torus": Solid(_torus_draw, _torus_inside, _torus_area),
}


@dataclass(frozen=True, eq=False)
class Part:
    """A solid of half extents (3,), under x ↦ axes x + centre; axes (3, 3) orthogonal."""

    solid: Solid
    half: np.ndarray
    axes: np.ndarray
    centre: np.ndarray

    def inside(self, points: np.ndarray) -> np.ndarray:
        """Which of the points (N, 3) lie inside, (N,)."""
        return self.solid.inside((points - self.centre) @ self.axes * (1 + SUNK), self.half)

    def moved(self, linear: np.ndarray) -> "Part":
        """Under an orthogonal map (3, 3)."""
        return Part(self.solid, self.half, linear @ self.axes, linear @ self.centre)


@dataclass(frozen=True, eq=False)
class Assembly(Surface):
    """The outer surface of parts that overlap. A place is the point itself, followed by the unit normal."""

    parts: list[Part]
    bounds = ((-np.inf, np.inf), (-np.inf, np.inf))

    def draw(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """Places (count, 6), uniform on the surface."""
        areas = np.array([part.solid.area(part.half) for part in self.parts])
        kept: list[np.ndarray] = []
        while sum(map(len, kept)) < count:
            which = rng.multinomial(count, areas / areas.sum())
            for number, (part, some) in enumerate(zip(self.parts, which, strict=True)):
                points, normals = part.solid.draw(int(some), part.half, rng)
                points, normals = points @ part.axes.T + part.centre, normals @ part.axes.T
                open_ = np.ones(len(points), dtype=bool)
                for other in self.parts[:number] + self.parts[number + 1 :]:
                    open_ &= ~other.inside(points)
                kept.append(np.hstack([points, normals])[open_])
        return rng.permutation(np.concatenate(kept))[:count]

    def points(self, chart: np.ndarray) -> np.ndarray:
        """The points (N, 3) at places (N, 6)."""
        return chart[:, :3].copy()

    def normals(self, chart: np.ndarray) -> np.ndarray:
        """Unit normals (N, 3) at places (N, 6)."""
        return chart[:, 3:]


NEARLY = 0.25  # of the symmetric objects that get one more part, to one side
GROUPS = ((), ((1.0, 0, 0),), ((1.0, 0, 0), (0, 1.0, 0)))  # normals of the planes that an object has
CHANCES = (0.3, 0.5, 0.2)


def draw_assembly(rng: np.random.Generator) -> tuple[Assembly, Planes]:
    """A body with up to four further parts or groups of mirrored ones, and the planes it is symmetric about.

    Planes that come about by chance are not known, such as those of a body whose parts are all but hidden in it.
    """
    normals = np.array(GROUPS[rng.choice(len(GROUPS), p=CHANCES)]).reshape(-1, 3)
    mirrors = [np.eye(3) - 2 * np.outer(n, n) for n in normals]
    body = _part(rng, 1.0, _commuting(rng, len(normals)), np.zeros(3), slim=0.1)
    parts = [body]
    for _ in range(rng.integers(1, 5)):
        size = float(np.exp(rng.uniform(np.log(0.12), np.log(0.6))))
        spot = body.solid.draw(1, body.half, rng)[0][0] @ body.axes.T + body.centre
        if len(normals) and rng.random() < 0.5:  # across a plane, or all of them
            for n in normals[: rng.integers(1, len(normals) + 1)]:
                spot = spot - n * (n @ spot)
        on = [bool(abs(n @ spot) < 1e-9) for n in normals]
        axes = _commuting(rng, sum(on), [n for n, each in zip(normals, on, strict=True) if each])
        images = [_part(rng, size, axes, spot, slim=0.15)]
        for mirror, each in zip(mirrors, on, strict=True):
            if not each:
                images += [image.moved(mirror) for image in images]
        parts += images
    if len(normals) and rng.random() < NEARLY:
        size, spot = rng.uniform(0.2, 0.5), body.solid.draw(1, body.half, rng)[0][0] @ body.axes.T + body.centre
        parts.append(_part(rng, size, uniform_rotation(rng), spot, slim=0.2))
        normals = np.zeros((0, 3))
    return Assembly(parts), Planes(normals, np.zeros_like(normals))


def _part(rng: np.random.Generator, size: float, axes: np.ndarray, centre: np.ndarray, slim: float) -> Part:
    """A random solid of this greatest half extent; slim: its least one beside that, at least."""
    name = ("box", "ellipsoid", "cylinder", "torus")[rng.choice(4, p=[0.35, 0.25, 0.3, 0.1])]
    half = np.exp(rng.uniform(np.log(slim), 0, 3))
    if name == "torus":
        half[1], half[2] = half[0], half[0] * rng.uniform(0.1, 0.4)
    if name in ("ellipsoid", "cylinder") and rng.random() < 0.5:  # round
        half[1] = half[0]
    return Part(SOLIDS[name], half / half.max() * size, axes, centre)


def _commuting(rng: np.random.Generator, count: int, normals: Sequence = ((1.0, 0, 0), (0, 1.0, 0))) -> np.ndarray:
    """Axes (3, 3) of a part that is its own image in `count` of the planes: random as far as they may be."""
    shuffle = np.eye(3)[rng.permutation(3)]
    if count == 0:
        return uniform_rotation(rng)
    if count == 1:
        first = np.asarray(normals[0])
        return axis_rotation(int(np.abs(first).argmax()), rng.uniform(0, 2 * np.pi)) @ shuffle
    return shuffle
