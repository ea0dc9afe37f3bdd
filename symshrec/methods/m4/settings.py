"""What can be chosen about M4. No torch here: the schema of conf/ is made of these."""

import math
from dataclasses import dataclass, field

from symshrec.methods.settings import HARMLESS, MethodSettings, check_ranges

# Intercept, then weights of the features of `confidence`. `experiments/calibrate.py` fits these on clouds of the
# training split; results/calibration.json is its record.
CALIBRATION = (1.759, -82.546, -60.19, 236.37)
# Of `surface_features`, by `experiments/calibrate_surface.py`; results/surface_calibration.json.
SURFACE_CALIBRATION = (
    *(-20.828, 0.154, -3.054, 0.672, -4.237, 2.243, -9.336, -1.35, 0.605),
    *(-0.408, 0.493, 0.219, 0.877, 6.028),
)


@dataclass(frozen=True)
class M4Settings(MethodSettings):
    """What there is to choose.

    Args:
        points: most points used of a cloud; the rest changes nothing.
        neighbours: points in a local plane.
        directions: normals tried in the search.
        candidates: local maxima of the search that are followed.
        votes: planes that pairs of points vote for that are followed beside them.
        separation_deg: least angle between two planes, in degrees.
        max_planes: most planes returned.
        together: whether planes whose images in each other are planes as well are estimated together.
        rounds: of point-to-plane alignment at most; 0 suffices for 1° and 1 %.
        calibration: intercept and weights of the logistic regression that gives confidences (see `confidence`).
        surface_calibration: the same, where density does not settle all and surface decides.

    Raises:
        ValueError: naming the setting that is out of its range.
    """

    name: str = field(default="m4", metadata=HARMLESS)
    points: int = 8192
    neighbours: int = 12
    directions: int = 1500
    candidates: int = 28
    votes: int = 24
    separation_deg: float = 5.0
    max_planes: int = 40
    together: bool = True
    rounds: int = 10
    calibration: tuple[float, ...] = CALIBRATION
    surface_calibration: tuple[float, ...] = SURFACE_CALIBRATION

    def __post_init__(self):
        super().__post_init__()
        ranges = {
            "points": (64, math.inf),
            "neighbours": (4, math.inf),
            "directions": (16, math.inf),
            "candidates": (1, math.inf),
            "votes": (1, math.inf),
            "separation_deg": (0, 90),
            "max_planes": (1, math.inf),
            "rounds": (0, math.inf),
        }
        check_ranges(self, ranges)
        for name, shipped in (("calibration", CALIBRATION), ("surface_calibration", SURFACE_CALIBRATION)):
            numbers = tuple(getattr(self, name))
            if len(numbers) != len(shipped):
                raise ValueError(f"{name} has {len(numbers)} numbers, expected {len(shipped)}")
            object.__setattr__(self, name, numbers)
