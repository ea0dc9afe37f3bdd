"""What can be chosen about the baselines. No torch here: the schema of conf/ is made of these."""

import math
from dataclasses import dataclass, field

from symshrec.methods.settings import HARMLESS, MethodSettings, check_ranges


@dataclass(frozen=True)
class IcpSettings(MethodSettings):
    """What there is to choose of both.

    Args:
        points: most used of a cloud. probes: of these, mirrored in every round of ICP.
        rounds: of ICP at most. kept: the share of the mirrored points, the best, that a round fits.
        within: how far from the cloud a mirrored point may land to count, in median distances of nearest neighbours.
        separation_deg: least angle between two planes, in degrees.
        count_threshold: the best count accuracy of both baselines on clouds of the training split.

    Raises:
        ValueError: naming the setting that is out of its range.
    """

    count_threshold: float = field(default=0.75, metadata=HARMLESS)
    points: int = 8192
    probes: int = 1000
    rounds: int = 50
    kept: float = 0.9
    within: float = 2.0
    separation_deg: float = 5.0

    def __post_init__(self):
        super().__post_init__()
        ranges = {
            "points": (4, math.inf),
            "probes": (4, math.inf),
            "rounds": (0, math.inf),
            "kept": (0.1, 1),
            "within": (0, math.inf),
            "separation_deg": (0, 90),
        }
        check_ranges(self, ranges)


@dataclass(frozen=True)
class PcaIcpSettings(IcpSettings):
    """What there is to choose: nothing beside `IcpSettings`."""

    name: str = field(default="pca_icp", metadata=HARMLESS)


@dataclass(frozen=True)
class RansacSettings(IcpSettings):
    """What there is to choose beside `IcpSettings`.

    Args:
        pairs: whose bisectors are tried, each on `first_probes` mirrored points.
        starts: of these, the best scored again on all probes and, where they differ, polished.
        coarse: how far from the cloud a mirrored point may land in scoring, as a share of the cloud's spread.
        max_planes: most planes polished and returned.
        seed: of the pairs; the same cloud gives the same planes.

    Raises:
        ValueError: naming the setting that is out of its range.
    """

    name: str = field(default="ransac", metadata=HARMLESS)
    probes: int = 500
    rounds: int = 30
    pairs: int = 2000
    first_probes: int = 32
    starts: int = 100
    coarse: float = 0.1
    max_planes: int = 16
    seed: int = 0

    def __post_init__(self):
        super().__post_init__()
        ranges = {name: (1, math.inf) for name in ("pairs", "first_probes", "starts", "max_planes")}
        check_ranges(self, ranges | {"coarse": (0, math.inf), "seed": (0, math.inf)})
