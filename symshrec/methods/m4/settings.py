"""What can be chosen about M4. No torch here: the schema of conf/ is made of these."""

import math
from dataclasses import dataclass, field

from symshrec.methods.settings import HARMLESS, MethodSettings, check_ranges

# Intercept, then weights of the features of `confidence`. `experiments/calibrate.py` fits these on clouds of the
# training split; results/calibration.json is its record.
CALIBRATION = (1.759, -82.546, -60.19, 236.37)


@dataclass(frozen=True)
class M4Settings(MethodSettings):
    """What there is to choose.

    Args:
        points: most points used of a cloud; the rest changes nothing.
        neighbours: points in a local plane.
        directions: normals tried in the search.
        candidates: local maxima of the search that are followed.
        separation_deg: least angle between two planes, in degrees.
        max_planes: most planes returned.
        together: whether planes whose images in each other are planes as well are estimated together.
        rounds: of point-to-plane alignment at most; 0 suffices for 1° and 1 %.
        calibration: intercept and weights of the logistic regression that gives confidences (see `confidence`).

    Raises:
        ValueError: naming the setting that is out of its range.
    """

    name: str = field(default="m4", metadata=HARMLESS)
    points: int = 8192
    neighbours: int = 12
    directions: int = 1500
    candidates: int = 28
    separation_deg: float = 5.0
    max_planes: int = 40
    together: bool = True
    rounds: int = 10
    calibration: tuple[float, ...] = CALIBRATION

    def __post_init__(self):
        super().__post_init__()
        object.__setattr__(self, "calibration", tuple(self.calibration))
        ranges = {
            "points": (64, math.inf),
            "neighbours": (4, math.inf),
            "directions": (16, math.inf),
            "candidates": (1, math.inf),
            "separation_deg": (0, 90),
            "max_planes": (1, math.inf),
            "rounds": (0, math.inf),
        }
        check_ranges(self, ranges)
        if len(self.calibration) != len(CALIBRATION):
            raise ValueError(f"calibration has {len(self.calibration)} numbers, expected {len(CALIBRATION)}")
