"""§2.3 for one cloud: which true planes were found, whether the first plane is right, and how many are false."""

from typing import NamedTuple

import numpy as np

from experiments.real_objects.meshes import DIAGONAL
from symshrec.planes import Planes, axis_angles

SURE = 0.5
RIGHT, BEYOND = (1.0, 0.01), (3.0, 0.02)  # degrees, and share of the diagonal


class Score(NamedTuple):
    """found: the share of the true planes. first: is the most confident plane right. Both NaN where nothing is true."""

    found: float
    first: float
    false: int


def score(planes: Planes, true: Planes, allowed: Planes) -> Score:
    """Of planes in order of confidence: those of at least SURE count as claimed.

    A plane is found within RIGHT of a claimed one; a claimed plane is false beyond BEYOND of all true and allowed ones.
    """
    planes = planes.ranked()
    sure, right = planes.confidences >= SURE, near(planes, true, *RIGHT)
    false = int((sure & (fates(planes, true, allowed) < 0)).sum())
    if not len(true):
        return Score(np.nan, np.nan, false)
    return Score(float(right[sure].any(axis=0).mean()), float(right[:1].any()), false)


def fates(planes: Planes, true: Planes, allowed: Planes) -> np.ndarray:
    """Of each plane (K,) int: 1 for right, -1 for false, 0 for neither."""
    right = near(planes, true, *RIGHT).any(axis=1)
    beyond = ~(near(planes, true, *BEYOND).any(axis=1) | near(planes, allowed, *BEYOND).any(axis=1))
    return right.astype(int) - beyond


def near(planes: Planes, others: Planes, degrees: float, share: float) -> np.ndarray:
    """(K, G): are two planes within so many degrees and, at the object's middle (0), that share of its diagonal."""
    signs = np.sign(planes.normals @ others.normals.T)
    apart = np.abs(planes.offsets[:, None] - signs * others.offsets[None])
    return (axis_angles(planes.normals, others.normals) <= np.radians(degrees)) & (apart <= share * DIAGONAL)
