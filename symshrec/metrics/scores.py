"""§2.3 mAP, PHC and the precision-recall curve to the organisers' letter, and beside them what these two hide.

The published average precision divides by the number of planes *matched*, so that a missed plane costs nothing and one
good guess per cloud scores 1; recall-aware AP divides the same sum by the number of true planes. Neither says whether
the number of planes is right; count accuracy does.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from symshrec.metrics.matching import Matches, chunks, match_planes
from symshrec.planes import PackedPlanes

METRICS = ("mAP", "PHC", "recall_aware_mAP", "recall", "count_accuracy")
RECALL_BINS = 11  # recall 0, 0.1, …, 1
CELLS_PER_CHUNK = 1 << 17  # (match, tolerance pair) cells scored at once, so that they stay in the cache


@dataclass(frozen=True, eq=False)
class Scores:
    """The scores of C clouds at T angular tolerances × E distance tolerances.

    thetas_deg (T,) degrees, epsilons (E,) shares of the diagonal, count_threshold: what they were scored with.
    average_precision, recall_aware_ap, recall: (T, E, C) in [0, 1]. phc: (T, E, C) bool.
    count_correct: (C,) bool. true_counts: (C,) int.
    curve: (T, E, C, 11) interpolated precision at recall 0, 0.1, …, 1; None where not asked for.
    """

    thetas_deg: np.ndarray
    epsilons: np.ndarray
    count_threshold: float
    average_precision: np.ndarray
    recall_aware_ap: np.ndarray
    phc: np.ndarray
    recall: np.ndarray
    count_correct: np.ndarray
    true_counts: np.ndarray
    curve: np.ndarray | None = None

    def __len__(self) -> int:
        """Number of clouds."""
        return len(self.true_counts)

    def means(self, mask=None) -> dict[str, np.ndarray]:
        """The five METRICS over the clouds of `mask` (C,) bool or indices, at every tolerance pair: (T, E) each.

        Raises:
            ValueError: where no cloud is left to average over.
        """
        return {name: values.mean(axis=-1) for name, values in self._per_cloud(mask)}

    def standard_errors(self, mask=None) -> dict[str, np.ndarray]:
        """How far chance moves each of these means where n clouds are drawn: (T, E), the standard deviation over √n.

        The deviation is that of n − 1 degrees of freedom; 0 for a single cloud. Errors as in `means`.
        """
        return {
            name: values.std(axis=-1) / np.sqrt(max(values.shape[-1] - 1, 1)) for name, values in self._per_cloud(mask)
        }

    def _per_cloud(self, mask) -> Iterator[tuple[str, np.ndarray]]:
        """Every metric of the clouds of `mask`: (T, E, n)."""
        mask = slice(None) if mask is None else mask
        if not len(self.true_counts[mask]):
            raise ValueError("no cloud to average over; check the filter or the subset")
        per_cloud = (self.average_precision, self.phc, self.recall_aware_ap, self.recall, self.count_correct)
        shape = self.phc.shape
        for name, values in zip(METRICS, per_cloud, strict=True):
            yield name, np.broadcast_to(values, shape)[..., mask]

    def mean(self, theta_index: int = 0, epsilon_index: int = 0, mask=None) -> dict[str, float]:
        """The five METRICS over the clouds of `mask` at one tolerance pair; errors as in `means`."""
        return {name: float(grid[theta_index, epsilon_index]) for name, grid in self.means(mask).items()}

    def mean_curve(self, theta_index: int = 0, epsilon_index: int = 0, mask=None) -> np.ndarray:
        """The set's precision-recall curve, (11,): the mean over the clouds of `mask`.

        Raises:
            ValueError: where the curves were not asked for, or no cloud is left.
        """
        if self.curve is None:
            raise ValueError("these scores hold no precision-recall curves; evaluate(..., curves=True)")
        chosen = self.curve[theta_index, epsilon_index][slice(None) if mask is None else mask]
        if not len(chosen):
            raise ValueError("no cloud to average over; check the filter or the subset")
        return chosen.mean(axis=0)


def evaluate(
    predicted: PackedPlanes,
    truth: PackedPlanes,
    diagonals,
    thetas_deg=(1.0,),
    epsilons=(0.01,),
    count_threshold: float = -np.inf,
    curves: bool = True,
) -> Scores:
    """Score the predictions of C clouds at every pair of T × E tolerances in one pass.

    AP is the sum of the precision at each match over the number of matches; PHC whether the first-ranked prediction
    matched. Both, and the curve, are 0 for a cloud without predictions, without a match or without true planes. The
    curve at recall r is the best precision at any recall ≥ r; bins above the last recall reached carry the precision of
    the last match. Recall-aware AP and recall divide by the number of true planes; for a cloud without any they are 1
    where the method rightly reports none (no confidence ≥ count_threshold), else 0.

    Args:
        predicted, truth: planes of the same C clouds, with unit normals.
        diagonals: (C,), of the axis-aligned bounding boxes of the clouds as given to the method.
        thetas_deg: (T,) degrees in [0, 90]. epsilons: (E,) shares of the diagonal.
        count_threshold: the confidence from which the method means a plane to count; −∞ counts every prediction.
            It touches count accuracy and clouds without true planes only: the ranking knows no cut.
        curves: also keep (T, E, C, 11) precision-recall curves.

    Raises:
        ValueError: for shapes that do not agree, values that are not finite or out of range.

    >>> from symshrec.planes import Planes
    >>> truth = PackedPlanes.pack([Planes([[1, 0, 0], [0, 1, 0]], np.zeros((2, 3)))])
    >>> predicted = PackedPlanes.pack([Planes([[1, 0, 0]], [[0, 0, 0]])])  # one of the two planes, exactly
    >>> evaluate(predicted, truth, diagonals=[1.0]).mean()
    {'mAP': 1.0, 'PHC': 1.0, 'recall_aware_mAP': 0.5, 'recall': 0.5, 'count_accuracy': 0.0}
    """
    matches = match_planes(predicted, truth, diagonals, thetas_deg, epsilons)
    grid = len(matches.thetas_deg), len(matches.epsilons)
    pairs, clouds, true_counts = grid[0] * grid[1], len(truth), truth.counts
    precision, recall_aware, recall = (np.zeros((pairs, clouds)) for _ in range(3))
    first_right = np.zeros((pairs, clouds), bool)
    curve = np.zeros((RECALL_BINS, pairs, clouds)) if curves else None
    for first, last in chunks((true_counts + 1) * pairs, CELLS_PER_CHUNK):
        here = slice(first, last)
        ranks = _ranks_of_matches(matches, first, last)
        precisions = np.divide(np.arange(1, len(ranks) + 1)[:, None, None], ranks, where=ranks > 0, out=ranks * 0.0)
        matched, total = (ranks > 0).sum(axis=0), precisions.sum(axis=0)
        precision[:, here] = total / np.maximum(matched, 1)
        recall_aware[:, here] = total / np.maximum(true_counts[here], 1)
        recall[:, here] = matched / np.maximum(true_counts[here], 1)
        first_right[:, here] = (ranks[:1] == 1).any(axis=0)
        if curve is not None:
            curve[:, :, here] = _interpolated(precisions, matched, true_counts[here])
    counts = _counts(predicted, count_threshold)
    for values in (recall_aware, recall):
        values[:, true_counts == 0] = counts[true_counts == 0] == 0
    return Scores(
        matches.thetas_deg,
        matches.epsilons,
        float(count_threshold),
        precision.reshape(*grid, clouds),
        recall_aware.reshape(*grid, clouds),
        first_right.reshape(*grid, clouds),
        recall.reshape(*grid, clouds),
        counts == true_counts,
        true_counts,
        None if curve is None else np.moveaxis(curve.reshape(RECALL_BINS, *grid, clouds), 0, -1),
    )


def _counts(predicted: PackedPlanes, threshold: float) -> np.ndarray:
    """Predictions per cloud of confidence ≥ threshold, (C,)."""
    running = np.concatenate([[0], np.cumsum(predicted.confidences >= threshold)])
    return np.diff(running[predicted.starts])


def _ranks_of_matches(matches: Matches, first: int, last: int) -> np.ndarray:
    """Ranks of the 1st, 2nd, … match of the clouds first ≤ c < last: (most matches, T·E, last − first), 0 for none."""
    rows = slice(*np.searchsorted(matches.clouds, [first, last]))
    clouds = matches.clouds[rows]
    holds = matches.holds(rows)
    running = np.cumsum(holds, axis=0, dtype=np.int32)
    starts = np.searchsorted(clouds, clouds)
    numbers = running - (running[starts] - holds[starts])  # of the match among those of its cloud, from 1
    row, pair = np.nonzero(holds)
    number = numbers[row, pair]
    ranks = np.zeros((number.max(initial=0), holds.shape[1], last - first), np.int32)
    ranks[number - 1, pair, clouds[row] - first] = matches.ranks[rows][row]
    return ranks


def _interpolated(precisions: np.ndarray, matched: np.ndarray, true_counts: np.ndarray) -> np.ndarray:
    """Precision (11, T·E, c) at recall 0, 0.1, …, 1 from the precision at each match (k, T·E, c).

    Recall k / K reaches b / 10 from k = ⌈b K / 10⌉ on, compared in whole numbers, so that no rounding moves a bin.
    """
    most = len(precisions)
    if not most:
        return np.zeros((RECALL_BINS, *matched.shape))
    last = np.take_along_axis(precisions, np.maximum(matched - 1, 0)[None], axis=0)
    best = np.maximum.accumulate(precisions[::-1], axis=0)[::-1]
    best = np.where(np.arange(most)[:, None, None] < matched, best, last)
    needed = -(-np.arange(RECALL_BINS)[:, None] * true_counts // (RECALL_BINS - 1))
    return np.take_along_axis(best, np.clip(needed, 1, most)[:, None, :] - 1, axis=0)
