"""What can be chosen about the oracle. No torch here: the schema of conf/ is made of these."""

import math
from dataclasses import dataclass, field

from symshrec.methods.settings import HARMLESS, MethodSettings, check_ranges


@dataclass(frozen=True)
class OracleSettings(MethodSettings):
    """How far off the oracle's planes are.

    Args:
        angle_deg: by which every plane is turned about the foot of the cloud's centroid, in [0, 90].
        offset: by which it is moved along its normal, a share of the cloud's diagonal.

    Raises:
        ValueError: naming the field that is out of its range.
    """

    name: str = field(default="oracle", metadata=HARMLESS)
    refine: bool = True
    angle_deg: float = 0.3
    offset: float = 0.003

    def __post_init__(self):
        super().__post_init__()
        check_ranges(self, {"angle_deg": (0, 90), "offset": (0, math.inf)})
