"""§2.1–2.2 Every choice behind the benchmark as a typed value; the defaults are the benchmark we publish.

The dataclasses hold plain values, lists and Enums only, so that Hydra can use them as its schema.
"""

from dataclasses import dataclass, field, fields, is_dataclass
from enum import Enum
from math import inf
from operator import attrgetter

POSITIVE = 1e-9
LIMITS = {
    "seed": (0, inf),
    "clouds_per_shard": (1, inf),
    "curves.citrus_a": (POSITIVE, inf),
    "curves.citrus_b": (1, inf),
    "curves.convexities_a": (POSITIVE, inf),
    "curves.convexities_b": (POSITIVE, 0.999),
    "curves.convexities_m": (1, inf),
    "curves.petal_a": (POSITIVE, inf),
    "curves.petal_b": (1, inf),
    "curves.petal_m": (1, inf),
    "curves.lemniscate_a": (POSITIVE, inf),
    "curves.egg_a": (POSITIVE, inf),
    "curves.mouth_a": (POSITIVE, inf),
    "curves.astroid_a": (POSITIVE, inf),
    "surface.cylinder_probability": (0, 1),
    "surface.height": (POSITIVE, inf),
    "surface.points": (64, inf),
    "surface.citrus_points": (64, inf),
    "pose.rotation_probability": (0, 1),
    "pose.translation_probability": (0, 1),
    "pose.translation": (0, inf),
    "noise.fraction": (0, 1),
    "noise.removed_fraction": (0, 1),
    "noise.uniform_n": (POSITIVE, inf),
    "noise.gaussian_n": (POSITIVE, inf),
    "noise.gaussian_scale": (0, inf),
    "noise.hard.cut_fraction": (0, 1),
    "noise.hard.hole_probability": (0, 1),
    "noise.hard.strong_n": (POSITIVE, inf),
    "noise.hard.outlier_fraction": (0, inf),
    "noise.hard.few_points": (1, inf),
    "noise.scan.density_ratio": (1, inf),
    "noise.scan.step_probability": (0, 1),
    "noise.scan.step_share": (0, 1),
    "noise.scan.distance": (0.6, inf),
    "noise.scan.reach": (1, 1e6),
    "noise.scan.cut_fraction": (0, 1),
    "noise.scan.bite_fraction": (0, 1),
    "noise.scan.bite_probability": (0, 1),
    "noise.scan.floor_width": (0, 100),
    "noise.scan.floor_offset": (0, inf),
    "noise.scan.floor_most": (1, inf),
    "noise.scan.bend": (0, 1),
    "planeless.shear": (POSITIVE, inf),
    "planeless.offset": (POSITIVE, inf),
    "planeless.bumps": (4, 100),
    "planeless.bump_height": (POSITIVE, 3),
    "planeless.bump_width_deg": (1, 90),
}
LISTS = (
    "noise.uniform_n",
    "noise.gaussian_n",
    "noise.hard.strong_n",
)  # values to choose from; every other list is a range


class CitrusForm(Enum):
    """Whether the citrus' b multiplies y (the organisers' later generator) or divides it (the paper's layout)."""

    multiply = 1
    divide = 2


class PetalFrequency(Enum):
    """The n of the petal's ρ = a + b cos(n u): 2m (as the organisers' later generator has it) or m."""

    two_m = 1
    m = 2


class CurveSampling(Enum):
    """How the curve's u is drawn: uniform in the parameter, evenly spaced in it, or uniform by arc length."""

    parameter = 1
    grid = 2
    arc_length = 3


class UnitScaling(Enum):
    """When x and y are scaled by 1/max: before the noise, after it (the noise shrinks with the curve), or never."""

    before_noise = 1
    after_noise = 2
    never = 3


class PoseGroup(Enum):
    """Which motions a pose is drawn from.

    track: a rotation about x and a translation, each with its probability. xy_axes: a rotation about x, then one about
    y, and a translation, each with its probability. so3: a uniform rotation and a translation, always. none: no motion.
    """

    track = 1
    so3 = 2
    xy_axes = 3
    none = 4


class DrawnPer(Enum):
    """Whether the noise's n is drawn once per cloud or anew for every point."""

    cloud = 1
    point = 2


class NoiseShift(Enum):
    """Whether a noisy point moves by three independent coordinates or by one scalar added to all three."""

    vector = 1
    scalar = 2


@dataclass
class CurvesConfig:
    """Table 1: parameter ranges [low, high], ends included; lists of integers are drawn as integers."""

    citrus_a: float = 1.0
    citrus_b: list[int] = field(default_factory=lambda: [1, 13])
    citrus_form: CitrusForm = CitrusForm.multiply
    convexities_a: list[float] = field(default_factory=lambda: [0.5, 1.1])
    convexities_b: list[float] = field(default_factory=lambda: [0.2, 0.9])
    convexities_m: list[int] = field(default_factory=lambda: [3, 9])
    petal_a: list[float] = field(default_factory=lambda: [1.0, 2.0])
    petal_b: list[int] = field(default_factory=lambda: [1, 6])
    petal_m: list[int] = field(default_factory=lambda: [1, 6])
    petal_frequency: PetalFrequency = PetalFrequency.two_m
    lemniscate_a: float = 1.0
    egg_a: float = 1.0
    mouth_a: float = 1.0
    astroid_a: float = 1.0
    sampling: CurveSampling = CurveSampling.parameter


@dataclass
class SurfaceConfig:
    """§2.1: from the curve to a cylinder or a cone. points counts a cloud before undersampling."""

    cylinder_probability: float = 0.5
    height: list[float] = field(default_factory=lambda: [0.5, 4.0])
    points: int = 6400
    citrus_points: int = 12800
    unit_scaling: UnitScaling = UnitScaling.before_noise


@dataclass
class PoseConfig:
    """§2.1: rotation and translation of the whole shape. translation is the half-width of the cube drawn from."""

    group: PoseGroup = PoseGroup.track
    rotation_probability: float = 0.5
    translation_probability: float = 0.5
    translation: float = 1.0
    whole_degrees: bool = True


@dataclass
class HardConfig:
    """P6–P9, beyond the paper: ranges of the share cut away, of outliers added, of points left; the noise's n."""

    cut_fraction: list[float] = field(default_factory=lambda: [0.1, 0.4])
    hole_probability: float = 0.5
    strong_n: list[int] = field(default_factory=lambda: [4, 5, 6, 7, 8, 9, 10])
    outlier_fraction: list[float] = field(default_factory=lambda: [0.05, 0.3])
    few_points: list[int] = field(default_factory=lambda: [256, 1024])


@dataclass
class ScanConfig:
    """P10–P15, beyond the paper; ranges [low, high], ends included.

    density_ratio, step_probability, step_share: P10's densest to sparsest, how often in one step, and which share of
    the points then lies on the sparse side. distance: of the scanner (P11) and the camera (P12) from the middle of the
    cloud's box, in diagonals; reach: of hidden point removal, its sphere's radius in distances of the farthest point.
    cut_fraction, bite_fraction, bite_probability: P13's shares of the points. floor_width: P14's patch, in widths of
    the shape; floor_offset: of its middle from the shape's, in its own widths; floor_most: points of the whole, in
    numbers of points of the shape. bend: P15's, a share of the diagonal.
    """

    density_ratio: list[float] = field(default_factory=lambda: [2.0, 10.0])
    step_probability: float = 0.5
    step_share: list[float] = field(default_factory=lambda: [0.3, 0.7])
    distance: float = 1.3
    reach: float = 100.0
    cut_fraction: list[float] = field(default_factory=lambda: [0.05, 0.3])
    bite_fraction: list[float] = field(default_factory=lambda: [0.01, 0.1])
    bite_probability: float = 0.5
    floor_width: list[float] = field(default_factory=lambda: [2.0, 4.0])
    floor_offset: list[float] = field(default_factory=lambda: [0.05, 0.2])
    floor_most: float = 6.0
    bend: list[float] = field(default_factory=lambda: [0.01, 0.04])


@dataclass
class NoiseConfig:
    """§2.2: the perturbations. Fractions are ranges of the share of points moved or removed.

    Uniform noise spans ± 1/n; Gaussian noise has the standard deviation gaussian_scale · n^-gaussian_power.
    """

    fraction: list[float] = field(default_factory=lambda: [0.3, 0.8])
    removed_fraction: list[float] = field(default_factory=lambda: [0.3, 0.8])
    uniform_n: list[int] = field(default_factory=lambda: [15, 17, 19, 20])
    gaussian_n: list[int] = field(default_factory=lambda: [20, 23, 27, 30])
    gaussian_power: float = 1.0
    gaussian_scale: float = 1.0
    n_per: DrawnPer = DrawnPer.cloud
    shift: NoiseShift = NoiseShift.vector
    hard: HardConfig = field(default_factory=HardConfig)
    scan: ScanConfig = field(default_factory=ScanConfig)


@dataclass
class PlanelessConfig:
    """Shapes without a mirror plane, beyond the paper; ranges [low, high], ends included.

    shear: how far a sheared shape leans for each unit of height. offset: between the axes of the two halves of a glued
    one. bumps, bump_height, bump_width_deg: of a blob, which is the unit sphere with so many bumps or dents, each up to
    so high (of the logarithm of the radius) and as wide as a Gaussian of this standard deviation.
    """

    shear: list[float] = field(default_factory=lambda: [0.5, 1.0])
    offset: list[float] = field(default_factory=lambda: [0.2, 0.5])
    bumps: list[int] = field(default_factory=lambda: [6, 12])
    bump_height: list[float] = field(default_factory=lambda: [0.3, 0.6])
    bump_width_deg: list[float] = field(default_factory=lambda: [20.0, 40.0])


@dataclass
class SplitConfig:
    """How many clouds a split holds; exact counts per perturbation and family, spread evenly where None."""

    clouds: int = 0
    perturbations: dict[str, int] | None = None
    families: dict[str, int] | None = None


@dataclass
class BenchmarkConfig:
    """A whole benchmark: the same values give the same bytes."""

    seed: int = 2023
    curves: CurvesConfig = field(default_factory=CurvesConfig)
    surface: SurfaceConfig = field(default_factory=SurfaceConfig)
    pose: PoseConfig = field(default_factory=PoseConfig)
    noise: NoiseConfig = field(default_factory=NoiseConfig)
    planeless: PlanelessConfig = field(default_factory=PlanelessConfig)
    splits: dict[str, SplitConfig] = field(default_factory=dict)
    clouds_per_shard: int = 500


def check_config(config: BenchmarkConfig) -> None:
    """Refuse values that no benchmark can be made from.

    Raises:
        ValueError: naming the field, its value and what is allowed.
    """
    for name, (low, high) in LIMITS.items():
        value = attrgetter(name)(config)
        values = list(value) if isinstance(value, list | tuple) else [value]
        if isinstance(value, list | tuple) and name not in LISTS and (len(values) != 2 or values[0] > values[1]):
            raise ValueError(f"{name} is {value}; it must be [low, high] with low ≤ high")
        if not values or not all(low <= each <= high for each in values):
            raise ValueError(f"{name} is {value}; every value must lie in [{low}, {high}], and there must be one")
    for split in config.splits:
        if not split.isidentifier():
            raise ValueError(f"split {split!r}: a split's name consists of letters, digits and underscores")
    if not config.splits:
        raise ValueError("splits is empty; name one or more splits with their number of clouds")


def plain(value):
    """A config as JSON-ready dicts, lists and scalars; an Enum becomes its name."""
    if is_dataclass(value):
        return {each.name: plain(getattr(value, each.name)) for each in fields(value)}
    if isinstance(value, dict):
        return {str(name): plain(each) for name, each in value.items()}
    if isinstance(value, list | tuple):
        return [plain(each) for each in value]
    return value.name if isinstance(value, Enum) else value


def differences(folder: dict, asked: dict, prefix: str = "") -> list[str]:
    """Lines `name: folder has x, asked for y` for every value in which two plain configs differ."""
    lines = []
    for name in sorted(folder.keys() | asked.keys()):
        here, there = folder.get(name), asked.get(name)
        if isinstance(here, dict) and isinstance(there, dict):
            lines += differences(here, there, f"{prefix}{name}.")
        elif here != there:
            lines.append(f"{prefix}{name}: folder has {here}, asked for {there}")
    return lines
