"""§2.1–2.2 Every choice behind the benchmark as a typed value; the defaults are the benchmark we publish.

The dataclasses hold plain values, lists and Enums only, so that Hydra can use them as its schema.
"""

from dataclasses import dataclass, field, fields, is_dataclass
from enum import Enum
from math import inf
from operator import attrgetter

from symshrec.benchmark.beyond import LIMITS_BEYOND, POSITIVE, HardConfig, PlanelessConfig, ScanConfig

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
    **LIMITS_BEYOND,
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
