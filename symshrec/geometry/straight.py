"""Whether points are on a straight line: every plane through it mirrors them, so they have no definite planes."""

from collections.abc import Iterator

import numpy as np

STRAIGHT = 1e-6  # of the spread: thinner in two directions, a cloud is a line; well above the rounding of float32
BLOCK = 65_536  # points of a larger cloud that are worked on at once, so that no second one of its size is held


def is_straight(
    points: np.ndarray, tolerance: float = STRAIGHT, middle: np.ndarray | None = None, scale: float = 1.0
) -> bool:
    """Whether the second largest spread (standard deviation) of points (N, 3) is within `tolerance` of the largest.

    Args:
        points: N ≥ 1, finite, float64; in one place they count as straight too.
        tolerance: a share of the largest spread; below 1e-7 rounding decides.
        middle: their centroid (3,), where it is known already.
        scale: what they are divided by before they are squared, for units too small or large for that.

    >>> steps = np.arange(9.0)[:, None]
    >>> is_straight(steps * [1, 2, 3]), is_straight(np.hstack([steps, steps**2, 0 * steps]))
    (True, False)
    """
    middle = points.mean(axis=0) if middle is None else middle
    spreads = np.linalg.eigvalsh(sum(block.T @ block for block in blocks(points, middle, scale)))
    return bool(spreads[1] <= tolerance**2 * spreads[2])


def blocks(points: np.ndarray, middle: np.ndarray, scale: float = 1.0) -> Iterator[np.ndarray]:
    """The points about `middle` in units of `scale`, (BLOCK, 3) at a time.

    >>> [len(block) for block in blocks(np.zeros((BLOCK + 3, 3)), np.zeros(3))]
    [65536, 3]
    """
    for start in range(0, len(points), BLOCK):
        yield (points[start : start + BLOCK] - middle) / scale
