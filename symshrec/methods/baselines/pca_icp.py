"""Not in the paper: the three planes across the cloud's principal axes, checked and polished with ICP."""

import numpy as np

from symshrec.methods.baselines.icp import Target, distinct, polished
from symshrec.methods.baselines.settings import PcaIcpSettings
from symshrec.planes import Planes


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
