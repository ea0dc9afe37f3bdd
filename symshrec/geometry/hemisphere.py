"""Directions spread evenly over half a sphere, as M4 searches and M2's heads start."""

import numpy as np


def hemisphere_directions(count: int) -> np.ndarray:
    """Unit vectors (count, 3) spread evenly over the half sphere z > 0, by the golden angle (a Fibonacci spiral).

    A plane's normal has no sign, so half a sphere holds every plane through the origin once.

    Raises:
        ValueError: for a count below 1.

    >>> hemisphere_directions(2).round(3).tolist()
    [[0.968, 0.0, 0.25], [-0.488, 0.447, 0.75]]
    """
    if count < 1:
        raise ValueError(f"count is {count}; there is at least one direction")
    rows = np.arange(count, dtype=np.float64)
    heights, turns = (rows + 0.5) / count, np.pi * (3 - 5**0.5) * rows
    radii = np.sqrt(1 - heights * heights)
    return np.stack([radii * np.cos(turns), radii * np.sin(turns), heights], axis=1)
