"""§3.1, step 3: N·M predictions → DBSCAN → clusters' axes → non-maximum suppression → planes."""

from collections.abc import Iterator
from itertools import combinations_with_replacement

import numpy as np

from symshrec.methods.m1.settings import DecodeSettings
from symshrec.planes import Planes

NOISE = -1


def decode(normals: np.ndarray, confidences: np.ndarray, centres: np.ndarray, settings: DecodeSettings) -> Planes:
    """The planes of one cloud from what its points predict.

    A cluster's normal is the principal axis of its members, weighted by their confidences: the single most confident
    one would be several tenths of a degree off. Its confidence is the sum of its members' over the number of points,
    each times exp(−θ²/2σ²) for its angle θ to the axis, at most 1. All planes go through the mean predicted centre.

    Args:
        normals: (N, M, 3) unit vectors, the points in an order that leaves the first of them well spread (farthest
            point sampling does); their signs carry no meaning.
        confidences: (N, M) in [0, 1].
        centres: (N, 3).

    Returns:
        Planes, the most confident first; none where no prediction is confident enough.
    """
    count = len(normals)
    clustered = min(settings.cluster_points, count)
    sure = confidences >= settings.confidence
    first = sure[:clustered]
    closeness = np.cos(np.deg2rad(settings.eps_deg))
    labels = dbscan(normals[:clustered][first], closeness, max(1, round(settings.min_share * clustered)))
    if not len(labels) or labels.max() == NOISE:
        return Planes.empty()
    axes = principal_axes(normals[:clustered][first], confidences[:clustered][first], labels, labels.max() + 1)
    normals, confidences = normals[sure], confidences[sure]
    nearness = np.abs(normals @ axes.T)  # (P, C)
    labels = np.where(nearness.max(1) >= closeness, nearness.argmax(1), NOISE)
    axes = principal_axes(normals, confidences, labels, len(axes))
    support = agreement(normals, confidences, labels, axes, np.deg2rad(settings.agreement_deg)) / count
    kept = suppressed(axes, support, np.cos(np.deg2rad(settings.separation_deg)))
    centre = centres.mean(0)
    return Planes(axes[kept], np.tile(centre, (len(kept), 1)), np.minimum(support[kept], 1.0))


def dbscan(normals: np.ndarray, closeness: float, neighbours: int) -> np.ndarray:
    """DBSCAN (Ester et al. 1996) of axes under 1 − |cos|, by products of whole blocks of rows.

    Args:
        normals: (P, 3) of length one. closeness: |cos| from which two are neighbours. neighbours: what makes a core
            point, itself included.

    Returns:
        (P,) cluster of each, from 0, or −1 for noise.
    """
    near = np.abs(normals.astype(np.float32) @ normals.T.astype(np.float32)) >= np.float32(closeness)
    core = near.sum(1) >= neighbours
    labels = np.full(len(normals), NOISE)
    for cluster, seed in enumerate(_unlabelled(core, labels)):
        reached = near[seed].copy()
        spread = np.zeros_like(core)
        while (front := reached & core & ~spread).any():
            spread |= front
            reached |= near[front].any(0)
        labels[reached & (labels == NOISE)] = cluster
    return labels


def _unlabelled(core: np.ndarray, labels: np.ndarray) -> Iterator[np.intp]:
    """Core points without a cluster, one after the other, while `labels` fills up."""
    for point in np.flatnonzero(core):
        if labels[point] == NOISE:
            yield point


def principal_axes(normals: np.ndarray, weights: np.ndarray, labels: np.ndarray, count: int) -> np.ndarray:
    """First principal axis of every cluster's weighted outer products: (count, 3), from (P, 3), (P,) and (P,)."""
    bins, moments = labels + 1, np.empty((count, 3, 3))  # the first bin takes the noise
    for row, column in combinations_with_replacement(range(3), 2):
        sums = np.bincount(bins, weights * normals[:, row] * normals[:, column], count + 1)[1:]
        moments[:, row, column] = moments[:, column, row] = sums
    return np.linalg.eigh(moments)[1][:, :, -1]


def agreement(
    normals: np.ndarray, confidences: np.ndarray, labels: np.ndarray, axes: np.ndarray, sigma: float
) -> np.ndarray:
    """Sums of every cluster's confidences (P,), each times exp(−θ²/2σ²): (C,), from (P, 3), axes (C, 3) and radians."""
    members = labels > NOISE
    normals, labels = normals[members], labels[members]
    squared_sines = 1 - np.einsum("pd,pd->p", normals, axes[labels]) ** 2  # θ² where it matters
    return np.bincount(labels, confidences[members] * np.exp(-squared_sines / (2 * sigma**2)), len(axes))


def suppressed(normals: np.ndarray, confidences: np.ndarray, closeness: float) -> np.ndarray:
    """Non-maximum suppression: rows that stay, the most confident first, none closer than |cos| to one before it."""
    kept: list[int] = []
    for row in np.argsort(-confidences, kind="stable"):
        if confidences[row] > 0 and (np.abs(normals[kept] @ normals[row]) <= closeness).all():
            kept.append(int(row))
    return np.array(kept, dtype=np.int64)
