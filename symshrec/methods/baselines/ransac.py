"""Not in the paper: bisector planes of random pairs of points, scored; the best polished with ICP."""

from dataclasses import dataclass

import numpy as np

from symshrec.methods.baselines.icp import Target, distinct, polished
from symshrec.methods.fit.settings import check_ranges
from symshrec.planes import Planes

NEAR = 0.2  # of the cloud's spread: the two points of a nearer pair say little of their bisector's direction


@dataclass(frozen=True)
class RansacSettings:
    """What there is to choose.

    Args:
        points, probes, rounds, kept, within, separation_deg: see `PcaIcpSettings`.
        pairs: whose bisectors are tried, each on `first_probes` mirrored points.
        starts: of these, the best scored again on all probes and, where they differ, polished.
        coarse: how far from the cloud a mirrored point may land in scoring, as a share of the cloud's spread.
        max_planes: most planes polished and returned.
        seed: of the pairs; the same cloud gives the same planes.
        count_threshold, workers, refine: see `SymmetryMethod`.

    Raises:
        ValueError: naming the setting that is out of its range.
    """

    points: int = 8192
    probes: int = 500
    rounds: int = 30
    kept: float = 0.9
    within: float = 2.0
    separation_deg: float = 5.0
    pairs: int = 2000
    first_probes: int = 32
    starts: int = 100
    coarse: float = 0.1
    max_planes: int = 16
    seed: int = 0
    count_threshold: float = 0.75
    workers: int = 1
    refine: bool = False

    def __post_init__(self):
        whole = ("points", "probes", "pairs", "first_probes", "starts", "max_planes")
        ranges = {name: (1, np.inf) for name in whole} | {
            "rounds": (0, np.inf),
            "kept": (0.1, 1),
            "within": (0, np.inf),
            "separation_deg": (0, 90),
            "coarse": (0, np.inf),
            "seed": (0, np.inf),
        }
        check_ranges(self, ranges)


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
