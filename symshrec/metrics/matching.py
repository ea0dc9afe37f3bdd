"""§2.3 Which prediction is which true plane, at every pair of tolerances at once.

A pair (prediction, true plane) costs the same at every tolerance; the tolerances only decide whether it is a candidate.
So each pair that is a candidate at the loosest tolerances carries one bit per tolerance pair (θ, ε), and the greedy
matching runs on machine words: 64 tolerance pairs cost what one costs. Predictions near no true plane drop out at once
and live on only in the ranks of the others. All decisions are taken in float64 with thresholds inclusive.
"""

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from symshrec.planes import PackedPlanes

PAIRS_PER_CHUNK = 1 << 15  # (prediction, true plane) pairs compared at once: a dozen arrays of it fit the cache
UNIT_LENGTH_TOLERANCE = 1e-6


@dataclass(frozen=True, eq=False)
class Matches:
    """The n matches that occur at one tolerance pair or more, by cloud, then by rank of the prediction.

    clouds, ranks (1 is the most confident), predictions, true_planes: (n,); the last two are rows of the packed planes.
    words: (n, ⌈T·E / 64⌉) uint64, one bit per tolerance pair.  thetas_deg (T,), epsilons (E,).
    """

    clouds: np.ndarray
    ranks: np.ndarray
    predictions: np.ndarray
    true_planes: np.ndarray
    words: np.ndarray
    thetas_deg: np.ndarray
    epsilons: np.ndarray

    def holds(self, rows: slice = slice(None)) -> np.ndarray:
        """(rows, T·E) uint8, 1 where the match holds at that tolerance pair; θ is the slower index."""
        pairs = len(self.thetas_deg) * len(self.epsilons)
        return np.unpackbits(self.words[rows].view(np.uint8), axis=1, count=pairs, bitorder="little")


@dataclass(frozen=True, eq=False)
class PlaneErrors:
    """How far the matched predictions are off, all arrays (n,).

    angles_deg: between the normals, [0, 90]. offsets: distance of the predicted point from the true plane, as a share
    of the cloud's diagonal. clouds, ranks, predictions, true_planes: as in Matches.
    """

    clouds: np.ndarray
    ranks: np.ndarray
    predictions: np.ndarray
    true_planes: np.ndarray
    angles_deg: np.ndarray
    offsets: np.ndarray


def match_planes(predicted: PackedPlanes, truth: PackedPlanes, diagonals, thetas_deg, epsilons) -> Matches:
    """Match predictions to true planes as the organisers do, at all T × E tolerances.

    Per cloud, in stable descending order of confidence, each prediction takes, among the true planes still free with
    dA = 1 − |n·n̂| ≤ 1 − cos θ and dP = |n̂·(p − p̂)| ≤ ε·diagonal (n̂, p̂ the true plane's), the one of least
    dA + dP/diagonal, the first of equals.

    Args:
        predicted, truth: planes of the same C clouds, with unit normals.
        diagonals: (C,), of the clouds' axis-aligned bounding boxes.
        thetas_deg: (T,) degrees in [0, 90].
        epsilons: (E,), shares of the diagonal, not negative.

    Raises:
        ValueError: for shapes that do not agree, values that are not finite or out of range.

    >>> from symshrec.planes import Planes
    >>> truth = PackedPlanes.pack([Planes([[1, 0, 0], [0, 1, 0]], np.zeros((2, 3)))])
    >>> predicted = PackedPlanes.pack([Planes([[0, 1, 0], [0, 0, 1]], np.zeros((2, 3)), [0.5, 0.9])])
    >>> matches = match_planes(predicted, truth, [2.0], [1.0], [0.01])
    >>> matches.predictions.tolist(), matches.true_planes.tolist(), matches.ranks.tolist()
    ([0], [1], [2])
    """
    diagonals, thetas_deg, epsilons = _checked(predicted, truth, diagonals, thetas_deg, epsilons)
    limits = np.array([1.0 - math.cos(math.radians(theta)) for theta in thetas_deg])
    cloud_of_row = np.repeat(np.arange(len(predicted)), predicted.counts)
    ranking = np.lexsort((-predicted.confidences, cloud_of_row))  # lexsort is stable
    ranks = np.arange(1, len(ranking) + 1) - predicted.starts[cloud_of_row]
    candidate_words = _CandidateWords.of(limits, epsilons)
    found = []
    for first, last in chunks(predicted.counts * truth.counts, PAIRS_PER_CHUNK):
        here = slice(predicted.starts[first], predicted.starts[last])
        rows, clouds, row_ranks = ranking[here], cloud_of_row[here], ranks[here]
        loosest = limits.max(), epsilons.max()
        places, true_rows, angular, offset = _near_pairs(predicted, truth, rows, clouds, diagonals, *loosest)
        candidates = candidate_words(angular, offset, diagonals[clouds[places]])
        won = _greedy(candidates, clouds[places], places, true_rows)
        kept = np.flatnonzero(won.any(axis=1))
        places = places[kept]
        found.append((clouds[places], row_ranks[places], rows[places], true_rows[kept], won[kept]))
    clouds, row_ranks, rows, true_rows, words = (np.concatenate(column) for column in zip(*found, strict=True))
    return Matches(clouds, row_ranks, rows, true_rows, words, thetas_deg, epsilons)


def plane_errors(predicted: PackedPlanes, truth: PackedPlanes, diagonals, theta_deg=1.0, epsilon=0.01) -> PlaneErrors:
    """Angle and offset of every match at one tolerance pair; arguments and errors as in `match_planes`.

    >>> from symshrec.planes import Planes
    >>> truth, predicted = (PackedPlanes.pack([Planes([[1, 0, 0]], [[x, 0, 0]])]) for x in (0.0, 0.25))
    >>> errors = plane_errors(predicted, truth, [2.0], theta_deg=5, epsilon=0.5)
    >>> errors.angles_deg.tolist(), errors.offsets.tolist()
    ([0.0], [0.125])
    """
    matches = match_planes(predicted, truth, diagonals, [theta_deg], [epsilon])
    normals, true_normals = predicted.normals[matches.predictions], truth.normals[matches.true_planes]
    sine = np.linalg.norm(np.cross(normals, true_normals), axis=1)
    cosine = np.abs(np.einsum("kd,kd->k", normals, true_normals))
    shifts = predicted.points[matches.predictions] - truth.points[matches.true_planes]
    scale = np.asarray(diagonals, dtype=np.float64)[matches.clouds]
    return PlaneErrors(
        matches.clouds,
        matches.ranks,
        matches.predictions,
        matches.true_planes,
        np.degrees(np.arctan2(sine, cosine)),
        _share(np.abs(np.einsum("kd,kd->k", true_normals, shifts)), scale),
    )


def chunks(costs: np.ndarray, budget: int) -> Iterator[tuple[int, int]]:
    """Consecutive ranges (first, last) of clouds of about `budget` cost each; always one at least, if empty.

    >>> list(chunks(np.array([3, 3, 3, 3]), budget=6))
    [(0, 1), (1, 3), (3, 4)]
    """
    cuts = np.flatnonzero(np.diff(np.cumsum(costs) // budget)) + 1
    edges = [0, *cuts.tolist(), len(costs)]
    return itertools.pairwise(edges)


def _checked(predicted, truth, diagonals, thetas_deg, epsilons):
    diagonals = np.asarray(diagonals, dtype=np.float64)
    if not len(predicted) == len(truth) == diagonals.size or diagonals.ndim != 1:
        raise ValueError(
            f"predictions of {len(predicted)} clouds, truth of {len(truth)} and diagonals of shape {diagonals.shape} "
            "do not belong together; each needs one entry per cloud"
        )
    bad = np.flatnonzero(~((diagonals >= 0) & np.isfinite(diagonals)))
    if bad.size:
        raise ValueError(f"diagonals[{bad[0]}] is {diagonals[bad[0]]}; a bounding box's diagonal is finite and ≥ 0")
    for name, planes in (("predicted", predicted), ("truth", truth)):
        columns = (planes.normals, planes.points, planes.confidences)
        if not all(np.isfinite(column).all() for column in columns):
            raise ValueError(f"{name} planes hold values that are not finite")
        if (np.abs(np.linalg.norm(planes.normals, axis=1) - 1.0) > UNIT_LENGTH_TOLERANCE).any():
            raise ValueError(f"{name} normals are not of unit length; build them through Planes")
    tolerances = []
    for name, values, most in (("thetas_deg", thetas_deg, 90.0), ("epsilons", epsilons, np.inf)):
        values = np.atleast_1d(np.asarray(values, dtype=np.float64))
        if values.ndim != 1 or not values.size or not ((values >= 0) & (values <= most)).all():
            raise ValueError(f"{name} must be one or more numbers in [0, {most:g}], got {values.tolist()}")
        tolerances.append(values)
    return diagonals, *tolerances


def _dot(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Row by row, coordinate by coordinate: no fused or blocked product may shift a threshold that is met exactly."""
    product = left * right
    return product[:, 0] + product[:, 1] + product[:, 2]


def _share(offsets: np.ndarray, diagonals: np.ndarray) -> np.ndarray:
    """offsets / diagonals; 0 where the cloud has no extent, whose only candidates have offset 0."""
    return np.divide(offsets, diagonals, out=np.zeros_like(offsets), where=diagonals > 0)


def _near_pairs(predicted, truth, rows, clouds, diagonals, limit, epsilon):
    """The pairs that are candidates at the loosest tolerances, by prediction, then by cost, then by true plane.

    Returns the predictions as indices into `rows`, the rows of the true planes, dA and dP, all (n,).
    """
    counts = truth.counts[clouds]
    places = np.repeat(np.arange(len(rows)), counts)
    true_rows = np.arange(len(places)) - np.repeat(np.cumsum(counts) - counts - truth.starts[clouds], counts)
    angular = 1.0 - np.abs(_dot(np.repeat(predicted.normals[rows], counts, axis=0), truth.normals[true_rows]))
    near = np.flatnonzero(angular <= limit)
    places, true_rows, angular = places[near], true_rows[near], angular[near]
    shifts = predicted.points[rows[places]] - truth.points[true_rows]
    offset = np.abs(_dot(truth.normals[true_rows], shifts))
    scale = diagonals[clouds[places]]
    near = np.flatnonzero(offset <= epsilon * scale)
    near = near[np.lexsort(((angular + _share(offset, scale))[near], places[near]))]
    return places[near], true_rows[near], angular[near], offset[near]


@dataclass(frozen=True, eq=False)
class _CandidateWords:
    """At which tolerance pairs two planes are candidates for each other, by table: a tight bound implies the looser.

    limits (T,) and epsilons (E,) in any order; row k of a table, (T or E, W) uint64, holds what remains where k
    bounds are exceeded.
    """

    limits: np.ndarray
    epsilons: np.ndarray
    by_angle: np.ndarray
    by_offset: np.ndarray

    @classmethod
    def of(cls, limits: np.ndarray, epsilons: np.ndarray) -> "_CandidateWords":
        limit_grid, epsilon_grid = (grid.ravel() for grid in np.meshgrid(limits, epsilons, indexing="ij"))
        limits, epsilons = np.sort(limits), np.sort(epsilons)
        return cls(limits, epsilons, _words(limit_grid >= limits[:, None]), _words(epsilon_grid >= epsilons[:, None]))

    def __call__(self, angular: np.ndarray, offset: np.ndarray, diagonals: np.ndarray) -> np.ndarray:
        """(n, W) for n pairs that are candidates at the loosest tolerances."""
        exceeded = (offset[:, None] > self.epsilons * diagonals[:, None]).sum(axis=1)
        return self.by_angle[np.searchsorted(self.limits, angular)] & self.by_offset[exceeded]


def _words(bits: np.ndarray) -> np.ndarray:
    """(n, B) bool as (n, ⌈B / 64⌉) uint64."""
    padded = np.pad(bits, ((0, 0), (0, -bits.shape[1] % 64)))
    return np.packbits(padded, axis=1, bitorder="little").view(np.uint64)


def _greedy(candidates: np.ndarray, clouds: np.ndarray, places: np.ndarray, true_rows: np.ndarray) -> np.ndarray:
    """Which pairs (n, W) are matched: each takes what neither its prediction nor its true plane has given away.

    Pairs come by cloud, rank and cost; the i-th pairs of all clouds, which share no plane, take their turn at once.
    """
    won = np.zeros_like(candidates)
    if not len(won):
        return won
    first_row = true_rows.min()
    spent_predictions = np.zeros((places[-1] + 1, won.shape[1]), np.uint64)
    spent_planes = np.zeros((true_rows.max() - first_row + 1, won.shape[1]), np.uint64)
    turns = np.arange(len(clouds)) - np.searchsorted(clouds, clouds)
    by_turn = np.argsort(turns, kind="stable")
    for pairs in np.split(by_turn, np.cumsum(np.bincount(turns))[:-1]):
        prediction, plane = places[pairs], true_rows[pairs] - first_row
        claim = candidates[pairs] & ~(spent_predictions[prediction] | spent_planes[plane])
        won[pairs] = claim
        spent_predictions[prediction] |= claim
        spent_planes[plane] |= claim
    return won
