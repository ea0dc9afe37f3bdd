"""§2.3 The evaluation, plainly: one cloud, one tolerance pair, one prediction at a time, as the organisers do it."""

import math
from collections.abc import Sequence

import numpy as np

from symshrec.planes import Planes


def dot(a: np.ndarray, b: np.ndarray) -> float:
    """Written out, since `sum` and `@` round differently between versions and machines."""
    return float(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


def match_plainly(predicted: Planes, truth: Planes, diagonal: float, theta_deg: float, epsilon: float) -> list[bool]:
    """Whether each prediction, by confidence, descending, finds a true plane of its own."""
    order = sorted(range(len(predicted)), key=lambda k: -predicted.confidences[k])
    unmatched = list(range(len(truth)))
    hits = []
    for k in order:
        candidates = []
        for j in unmatched:
            angular = 1 - abs(dot(predicted.normals[k], truth.normals[j]))
            offset = abs(dot(truth.normals[j], predicted.points[k] - truth.points[j]))
            if angular <= 1 - math.cos(math.radians(theta_deg)) and offset <= epsilon * diagonal:
                candidates.append((angular + offset / diagonal, j))
        if candidates:
            unmatched.remove(min(candidates)[1])
        hits.append(bool(candidates))
    return hits


def score_plainly(hits: Sequence[bool], true_count: int) -> dict:
    """AP, recall-aware AP, PHC, recall and 11-bin curve of one cloud with `true_count` ≥ 1 planes, or all 0."""
    precisions = [sum(hits[: rank + 1]) / (rank + 1) for rank, hit in enumerate(hits) if hit]
    if not precisions:
        return {"average_precision": 0.0, "recall_aware_ap": 0.0, "phc": False, "recall": 0.0, "curve": [0.0] * 11}
    curve = []
    for tenths in range(11):
        beyond = [p for k, p in enumerate(precisions, start=1) if 10 * k >= tenths * true_count]
        curve.append(max(beyond, default=precisions[-1]))
    return {
        "average_precision": sum(precisions) / len(precisions),
        "recall_aware_ap": sum(precisions) / true_count,
        "phc": hits[0],
        "recall": len(precisions) / true_count,
        "curve": curve,
    }


def evaluate_plainly(
    predicted: Sequence[Planes],
    truth: Sequence[Planes],
    diagonals: Sequence[float] | np.ndarray,
    theta_deg: float = 1.0,
    epsilon: float = 0.01,
) -> dict[str, np.ndarray]:
    """Per-cloud arrays (C,), and curve (C, 11), at one tolerance pair; names as in `symshrec.metrics.Scores`."""
    scores = [
        score_plainly(match_plainly(found, true, diagonal, theta_deg, epsilon), len(true))
        for found, true, diagonal in zip(predicted, truth, diagonals, strict=True)
    ]
    return {name: np.array([score[name] for score in scores]) for name in scores[0]}
