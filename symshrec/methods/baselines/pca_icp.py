"""Not in the paper: the three planes across the cloud's principal axes, checked and polished with ICP."""

from dataclasses import dataclass

import numpy as np

from symshrec.methods.baselines.icp import Target, distinct, polished
from symshrec.methods.fit.settings import check_ranges
from symshrec.planes import Planes


@dataclass(frozen=True)
class PcaIcpSettings:
    """What there is to choose.

    Args:
        points: most used of a cloud. probes: of these, mirrored in every round of ICP.
        rounds: of ICP at most. kept: the share of the mirrored points, the best, that a round fits.
        within: how far from the cloud a mirrored point may land to count, in median distances of nearest neighbours.
        separation_deg: least angle between two planes, in degrees.
        count_threshold, workers, refine: see `SymmetryMethod`.

    Raises:
        ValueError: naming the setting that is out of its range.
    """

    points: int = 8192
    probes: int = 1000
    rounds: int = 50
    kept: float = 0.9
    within: float = 2.0
    separation_deg: float = 5.0
    count_threshold: float = 0.75
    workers: int = 1
    refine: bool = False

    def __post_init__(self):
        ranges = {
            "points": (4, np.inf),
            "probes": (4, np.inf),
            "rounds": (0, np.inf),
            "kept": (0.1, 1),
            "within": (0, np.inf),
            "separation_deg": (0, 90),
        }
        check_ranges(self, ranges)


def detect_planes(points: np.ndarray, settings: PcaIcpSettings | None = None) -> Planes:
    """Up to three planes of one cloud (N, 3), by descending confidence, the share of points that fit when mirrored.

    Raises:
        ValueError: for a wrong shape or values that are not finite.
    """
    settings = settings or PcaIcpSettings()
    target = Target.of(points, settings.points, settings.within)
    if target is None:
        return Planes.empty()
    centroid = target.points.mean(axis=0)
    axes = np.linalg.eigh(np.cov(target.points.T))[1].T
    planes = [
        polished(target, axis, float(axis @ centroid), settings.probes, settings.rounds, settings.kept) for axis in axes
    ]
    normals, offsets = np.stack([normal for normal, _ in planes]), np.array([offset for _, offset in planes])
    found = Planes(normals, offsets[:, None] * normals, target.support(normals, offsets))
    return distinct(found, settings.separation_deg, len(axes))
