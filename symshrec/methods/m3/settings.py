"""§3.3 What can be chosen about M3. No torch here: the schema of conf/ is made of these."""

import math
import sys
from dataclasses import dataclass, field

from symshrec.methods.settings import HARMLESS, MethodSettings, check_ranges


@dataclass(frozen=True)
class M3Settings(MethodSettings):
    """What §3.3 fixes, and the diffusion time and the neighbours of the Laplacian, which it does not.

    Args:
        neighbours: K, within which a local maximum is the greatest: 200 in run R1, 250 in R2.
        eigenpairs: of the Laplacian.
        mollify: mollification factor of the triangulation, relative to its mean edge length.
        laplacian_neighbours: neighbours in the local triangulations (robust_laplacian's own value).
        time_factor: diffusion time in units of 1/λ₁; may be infinite.
        chamfer_limit: Chamfer distance, at diagonal 1, from which on a candidate is no symmetry.
        separation_deg: least angle between the normals of two planes, in degrees.

    Raises:
        ValueError: naming the setting that is out of its range.
    """

    name: str = field(default="m3", metadata=HARMLESS)
    count_threshold: float = field(default=0.95, metadata=HARMLESS)
    neighbours: int = 200
    eigenpairs: int = 10
    mollify: float = 1e-3
    laplacian_neighbours: int = 30
    time_factor: float = 0.3
    chamfer_limit: float = 100.0
    separation_deg: float = 5.0

    def __post_init__(self):
        super().__post_init__()
        ranges = {
            "neighbours": (1, math.inf),
            "eigenpairs": (2, math.inf),
            "mollify": (0, math.inf),
            "laplacian_neighbours": (3, math.inf),
            "time_factor": (sys.float_info.min, math.inf),
            "chamfer_limit": (sys.float_info.min, math.inf),
            "separation_deg": (0, 90),
        }
        check_ranges(self, ranges)
