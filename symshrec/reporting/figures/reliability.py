"""Whether confidences mean something: the share of planes that are right among those of about the same confidence."""

from dataclasses import dataclass

import numpy as np

from symshrec.metrics import plane_errors
from symshrec.reporting.tables.compared import Compared
from symshrec.reporting.tables.results import EPSILON, THETA_DEG

BINS = 10


@dataclass(frozen=True, eq=False)
class Reliability:
    """Predicted planes in B equal bins of confidence from 0 to 1, all arrays (B,), NaN where a bin is empty.

    confidences: their mean in the bin. correct: share of right planes. counts: planes in the bin.
    """

    name: str
    confidences: np.ndarray
    correct: np.ndarray
    counts: np.ndarray

    @property
    def error(self) -> float:
        """Expected calibration error: mean |share right − confidence| over all planes, in [0, 1]."""
        return float(np.nansum(np.abs(self.correct - self.confidences) * self.counts) / max(self.counts.sum(), 1))


def reliability(run: Compared, theta_deg: float = THETA_DEG, epsilon: float = EPSILON, bins: int = BINS) -> Reliability:
    """Sort a run's planes by confidence; one is right that the evaluation matches to a true plane.

    Raises:
        ValueError: naming the run, where a confidence lies outside [0, 1].
    """
    confidences = run.predicted.confidences
    outside = np.flatnonzero((confidences < 0) | (confidences > 1))
    if outside.size:
        raise ValueError(f"{run.name} has a confidence of {confidences[outside[0]]:g}, outside [0, 1]")
    right = np.zeros(len(confidences))
    right[plane_errors(run.predicted, run.truth, run.diagonals, theta_deg, epsilon).predictions] = 1
    places = np.minimum((confidences * bins).astype(int), bins - 1)
    counts = np.bincount(places, minlength=bins)
    confidence, correct = (
        np.divide(np.bincount(places, each, bins), counts, out=np.full(bins, np.nan), where=counts > 0)
        for each in (confidences, right)
    )
    return Reliability(run.name, confidence, correct, counts)
