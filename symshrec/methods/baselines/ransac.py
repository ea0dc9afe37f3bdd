"""Not in the paper: bisector planes of random pairs of points, scored; the best polished with ICP."""

import numpy as np

from symshrec.methods.baselines.icp import Target, distinct, polished
from symshrec.methods.baselines.settings import RansacSettings
from symshrec.planes import Planes

NEAR = 0.2  # of the cloud's spread: the two points of a nearer pair say little of their bisector's direction


def detect_planes(points: np.ndarray, settings: RansacSettings | None = None) -> Planes:
    """The planes of one cloud (N, 3), by descending confidence, the share of points that fit when mirrored.

    Raises:
        ValueError: for a wrong shape or values that are not finite.
    """
    settings = settings or RansacSettings()
    target = Target.of(points, settings.points, settings.within)
    if target is None:
        return Planes.empty()
    normals, offsets = bisectors(target, settings.pairs, np.random.default_rng(settings.seed))
    for probes, best in ((settings.first_probes, settings.starts), (settings.probes, None)):
        limit = settings.coarse * target.spread
        scores = -np.minimum(target.distances(normals, offsets, probes, limit), limit).mean(axis=1)
        order = np.argsort(-scores, kind="stable")[:best]
        normals, offsets, scores = normals[order], offsets[order], scores[order]
    starts = distinct(Planes(normals, offsets[:, None] * normals, scores), settings.separation_deg, settings.max_planes)
    planes = [
        polished(target, normal, offset, settings.probes, settings.rounds, settings.kept)
        for normal, offset in zip(starts.normals, starts.offsets, strict=True)
    ]
    normals, offsets = np.reshape([n for n, _ in planes], (-1, 3)), np.array([offset for _, offset in planes])
    found = Planes(normals, offsets[:, None] * normals, target.support(normals, offsets))
    return distinct(found, settings.separation_deg, settings.max_planes)


def bisectors(target: Target, pairs: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """The planes half-way between the points of random pairs: normals (K, 3) and offsets (K,), K ≤ pairs."""
    one, other = (target.points[rng.integers(len(target.points), size=pairs)] for _ in range(2))
    apart = one - other
    lengths = np.linalg.norm(apart, axis=1)
    far = lengths > NEAR * target.spread
    normals = apart[far] / lengths[far, None]
    return normals, np.einsum("kd,kd->k", normals, (one + other)[far] / 2)
