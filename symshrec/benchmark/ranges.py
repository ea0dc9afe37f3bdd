"""§2.1–2.2 Numbers drawn from the configured ranges [low, high]."""

from collections.abc import Sequence

import numpy as np


def uniform_in(rng: np.random.Generator, ends: Sequence[float]) -> float:
    """A real number between two ends, all equally likely."""
    low, high = ends
    return rng.uniform(low, high)


def whole_in(rng: np.random.Generator, ends: Sequence[int]) -> int:
    """A whole number between two ends, which count too, all equally likely."""
    low, high = ends
    return int(rng.integers(low, high, endpoint=True))
