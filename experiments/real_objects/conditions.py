"""§2.2 and beyond: what each object goes through, the benchmark's own perturbations at its strengths and at fixed ones.

A fixed strength is a range with one end at both ends. Where a direction is named, in shares of (across, along, up) of
the object's first true plane, the perturbation takes it in place of a random one.
"""

import zlib
from collections.abc import Callable
from dataclasses import dataclass, field
from operator import attrgetter
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from experiments.real_objects.meshes import DIAGONAL, MeshSurface
from symshrec.benchmark.config import NoiseConfig
from symshrec.benchmark.perturbations import PERTURBATIONS
from symshrec.benchmark.scene import Perturbed, Scene
from symshrec.planes import Planes, axis_angles

POINTS = 8000
SAME = np.radians(0.01)
Perturbation = Callable[[Scene, np.random.Generator, NoiseConfig], Perturbed]


class Aimed(np.random.Generator):
    """A generator whose normal deviates are one direction (3,): where a perturbation draws that, it gets this."""

    def __init__(self, direction: np.ndarray, bits: np.random.BitGenerator):
        super().__init__(bits)
        self.direction = direction

    def standard_normal(self, *_: Any, **__: Any) -> np.ndarray:
        """The direction."""
        return self.direction.copy()


@dataclass(frozen=True)
class Condition:
    """A perturbation by its name in the benchmark, or one of our own, with what differs from its settings."""

    title: str
    perturbation: str | Perturbation
    settings: dict[str, Any] = field(default_factory=dict)
    towards: tuple[float, float, float] | None = None

    @property
    def config(self) -> NoiseConfig:
        """The benchmark's settings with this condition's own."""
        config = NoiseConfig()
        for name, value in self.settings.items():
            *group, last = name.split(".")
            setattr(attrgetter(*group)(config) if group else config, last, value)
        return config

    def described(self) -> list:
        """Plain values that tell it from others."""
        named = self.perturbation if isinstance(self.perturbation, str) else self.perturbation.__name__
        return [named, self.settings, self.towards]


@dataclass(frozen=True, eq=False)
class Cloud:
    """points (N, 3) of an object of diagonal DIAGONAL about 0, its true planes, and those neither right nor false.

    turn (3, 3): the rotation that they came to lie in; before it, z pointed up.
    """

    points: np.ndarray
    true: Planes
    allowed: Planes
    turn: np.ndarray


def bent_across(scene: Scene, rng: np.random.Generator, config: NoiseConfig) -> Perturbed:
    """Ours: bent across the first plane, by a square less its linear part, so that the plane stays the best fit.

    By `scan.bend` of the diagonal. No plane is exact any more; the first alone counts as true.
    """
    across, along, _ = axes_of(scene)
    height = scene.points @ along
    height = (height - height.min()) / np.ptp(height)
    bow = height**2 - np.polyval(np.polyfit(height, height**2, 1), height)
    moved = scene.points + config.scan.bend[0] * scene.diagonal * np.outer(bow, across)
    return Perturbed(moved, {"bend": config.scan.bend[0]}, scene.planes[:1])


def axes_of(scene: Scene) -> np.ndarray:
    """(3, 3): the first plane's normal (where there is none, the longest axis), the longer and shorter axis in it."""
    centred = scene.points - scene.points.mean(axis=0)
    across = scene.planes.normals[0] if len(scene.planes) else np.linalg.eigh(centred.T @ centred)[1][:, -1]
    flat = centred - np.outer(centred @ across, across)
    along = np.linalg.eigh(flat.T @ flat)[1][:, -1]
    return np.stack([across, along, np.cross(across, along)])


def make(surface: MeshSurface, planes: Planes, nearly: Planes, object_name: str, name: str) -> Cloud:
    """The cloud of one object under one condition, the same whatever else is made."""
    condition = CONDITIONS[name]
    bits = np.random.PCG64([zlib.crc32(object_name.encode()), zlib.crc32(name.encode())])
    rng = np.random.Generator(bits)
    chart = surface.draw(POINTS, rng)
    turn = Rotation.random(random_state=rng).as_matrix()
    scene = Scene(surface.points(chart), planes, surface, chart)
    if condition.towards is not None:
        rng = Aimed(np.array(condition.towards) @ axes_of(scene), bits)
    perturb = condition.perturbation
    points, _, true = (PERTURBATIONS[perturb] if isinstance(perturb, str) else perturb)(scene, rng, condition.config)
    lost = (axis_angles(planes.normals, true.normals) > SAME).all(axis=1)  # bent, and so nearly true
    allowed = Planes(*(np.concatenate([getattr(each, key) for each in (planes[lost], nearly)]) for key in _ARRAYS))
    return Cloud(points @ turn.T, true.transformed(turn), allowed.transformed(turn), turn)


_ARRAYS = ("normals", "points", "confidences")
_OBLIQUE, _IN_PLANE, _ACROSS = (4.0, 3.0, 0.0), (0.0, 4.0, 3.0), (1.0, 0.0, 0.0)


def _both(value: float) -> list:
    return [value, value]


def _cut(percent: float) -> dict:
    return {"scan.bite_probability": 0.0, "scan.cut_fraction": _both(percent / 100)}


def _sweep(name: str, title: str, perturbation: str | Perturbation, values, settings: Callable, towards=None) -> dict:
    """A condition for each strength: names end in it, and the title's {} holds it."""
    return {
        f"{name}_{value}": Condition(title.format(value), perturbation, settings(value), towards) for value in values
    }


DRAWN = {
    name: Condition(title, name)
    for name, title in {
        "P0": "P0 as it is",
        "P1": "P1 uniform noise",
        "P2": "P2 Gaussian noise",
        "P3": "P3 undersampled",
        "P6": "P6 cut away",
        "P7": "P7 strong noise",
        "P8": "P8 outliers",
        "P9": "P9 256–1,024 points",
        "P10": "P10 uneven density",
        "P11": "P11 one-sided scanner",
        "P12": "P12 single view",
        "P13": "P13 cut or bite",
        "P14": "P14 floor",
        "P15": "P15 bent along a plane",
    }.items()
}
FIXED = {
    **_sweep(
        "gradient",
        "density {}:1 across the plane",
        "P10",
        (3, 10),
        lambda ratio: {"scan.density_ratio": _both(ratio), "scan.step_probability": 0.0},
        _ACROSS,
    ),
    "step_3": Condition(
        "density step 3:1 across the plane",
        "P10",
        {"scan.density_ratio": _both(3), "scan.step_probability": 1.0, "scan.step_share": _both(0.5)},
        _ACROSS,
    ),
    "scanner": Condition("scanner on one side", "P11", {}, _OBLIQUE),
    "view_oblique": Condition("one view, oblique", "P12", {}, _OBLIQUE),
    "view_in_plane": Condition("one view, in the plane", "P12", {}, _IN_PLANE),
    **_sweep(
        "cut",
        "half-space cut {} %",
        "P13",
        (10, 20, 30),
        _cut,
    ),
    **_sweep(
        "side_cut",
        "one side cut {} %",
        "P13",
        (5, 15),
        _cut,
        _ACROSS,
    ),
    **_sweep(
        "bite",
        "bite out of one side {} %",
        "P13",
        (1, 3, 10),
        lambda percent: {"scan.bite_probability": 1.0, "scan.bite_fraction": _both(percent / 100)},
    ),
    **_sweep(
        "bend",
        "bent across the plane {} %",
        bent_across,
        (1, 2, 4),
        lambda percent: {"scan.bend": _both(percent / 100)},
    ),
    **_sweep("floor", "floor {}× the object", "P14", (2, 4), lambda times: {"scan.floor_width": _both(times)}),
    **_sweep("outliers", "outliers {} %", "P8", (10,), lambda percent: {"hard.outlier_fraction": _both(percent / 100)}),
    **_sweep(
        "noise",
        "noise {} % of the diagonal",
        "P2",
        (1, 2, 3),
        lambda percent: {"fraction": _both(1.0), "gaussian_n": [1], "gaussian_scale": percent / 100 * DIAGONAL},
    ),
    **_sweep("points", "{} points", "P9", (300, 500, 1000), lambda count: {"hard.few_points": _both(count)}),
}
CONDITIONS = DRAWN | FIXED
