"""Beyond the paper: every choice behind P6–P15 and behind shapes without a mirror plane, as typed values."""

from dataclasses import dataclass, field
from math import inf

POSITIVE = 1e-9
LIMITS_BEYOND = {
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
    reach: float = 300.0
    cut_fraction: list[float] = field(default_factory=lambda: [0.05, 0.3])
    bite_fraction: list[float] = field(default_factory=lambda: [0.01, 0.1])
    bite_probability: float = 0.5
    floor_width: list[float] = field(default_factory=lambda: [2.0, 4.0])
    floor_offset: list[float] = field(default_factory=lambda: [0.05, 0.2])
    floor_most: float = 6.0
    bend: list[float] = field(default_factory=lambda: [0.01, 0.04])


@dataclass
class PlanelessConfig:
    """Shapes without a mirror plane, beyond the paper; ranges [low, high], ends included.

    shear: how far a sheared shape leans, in its heights, or where it is wider than high, in widths. offset: between the
    axes of the two halves of a glued one. bumps, bump_height, bump_width_deg: of a blob, which is the unit sphere with
    so many bumps or dents, each so high (of the logarithm of the radius) and as wide as a Gaussian of this standard
    deviation.
    """

    shear: list[float] = field(default_factory=lambda: [0.5, 1.0])
    offset: list[float] = field(default_factory=lambda: [0.3, 0.6])
    bumps: list[int] = field(default_factory=lambda: [6, 12])
    bump_height: list[float] = field(default_factory=lambda: [0.4, 0.8])
    bump_width_deg: list[float] = field(default_factory=lambda: [20.0, 40.0])
