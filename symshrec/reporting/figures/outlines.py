"""How far planes are drawn, how long a scale bar is, and from where a shape is looked at."""

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from symshrec.planes import Planes
from symshrec.reporting.figures.drawing import View

MARGIN = 0.06  # that a plane stands out of the shape by, as a share of its longer side
AZIMUTHS, ELEVATIONS = np.arange(-60, 120, 5.0), (18.0, 28.0, 38.0)
SLANT = 0.55  # cosine between a plane's normal and the view that shows both the plane and what is behind it


def outline(points: np.ndarray, normal: np.ndarray, point: np.ndarray) -> np.ndarray:
    """The part of a plane that lies by the shape: the least rectangle around the points' feet on it, widened a little.

    Args:
        points: (N, 3). normal: (3,), unit. point: (3,), on the plane.

    Returns:
        (4, 3), corners in order.
    """
    first = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    first /= np.linalg.norm(first)
    frame = np.stack([first, np.cross(normal, first)])
    feet = (points - point) @ frame.T
    try:
        hull = feet[ConvexHull(feet).vertices]
    except (QhullError, ValueError):  # on a line, or in one place
        hull = feet
    sides = np.roll(hull, -1, axis=0) - hull
    lengths = np.linalg.norm(sides, axis=1)
    angles = np.unique(
        np.round(np.arctan2(*sides[lengths > 1e-9 * max(lengths.max(), 1e-300)].T[::-1]) % (np.pi / 2), 6)
    )
    areas, turns = [], []
    for angle in angles if len(angles) else [0.0]:
        turns.append(np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]]))
        areas.append(float(np.prod(np.ptp(hull @ turns[-1].T, axis=0))))
    turn = turns[int(np.argmin(areas))]
    low, high = (end(hull @ turn.T, axis=0) for end in (np.min, np.max))
    grown = MARGIN * max((high - low).max(), 1e-12)
    (left, bottom), (right, top) = low - grown, high + grown
    corners = np.array([[left, bottom], [right, bottom], [right, top], [left, top]])
    return point + corners @ turn @ frame


def view_of(planes: Planes) -> View:
    """Where to look from, z up, so that no plane is seen from its edge, and none hides all behind it."""
    if not len(planes):
        return View()
    choices = [View(float(azimuth), elevation) for elevation in ELEVATIONS for azimuth in AZIMUTHS]
    towards = np.array([each.axes[2] for each in choices])
    off = np.abs(np.abs(towards @ planes.normals[:8].T) - SLANT)
    return choices[int(np.argmin(off.max(axis=1) + 0.1 * off.mean(axis=1)))]


def round_length(most: float) -> float:
    """The greatest of 1, 2 and 5 times a power of ten that is not above `most`.

    >>> [round_length(each) for each in (0.9, 37.0, 6.1)]
    [0.5, 20.0, 5.0]
    """
    power = 10.0 ** np.floor(np.log10(most))
    return float(next(step * power for step in (5, 2, 1) if step * power <= most * (1 + 1e-9)))
