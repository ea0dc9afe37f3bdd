"""M4 step 1: the floor or table that a scanned object stands on, which says nothing about the object's symmetry."""

import numpy as np

SAMPLE, TRIPLES = 1500, 300  # points that are looked at, and planes through three of them that are tried
THICK = 0.008  # distance to the plane, a share of the cloud's size, of points that may be the floor's
SHARE = 0.3  # of the cloud, at least, that is floor
ABOVE = 0.97  # of the rest, at least, that lies on one side of it
WIDER, LARGER = 1.25, 1.9  # than what stands on it: the floor along both of its axes, and in area
FEWEST = 60  # points of what stands on it
HIGH = 0.03  # of its own width: an object that is lower is a pattern on a sheet


def without_floor(points: np.ndarray, sample: np.ndarray) -> np.ndarray:
    """Which of the points (N, 3) do not belong to a floor, (N,) bool: all of them where there is none.

    A floor is a plane that holds a large share of the points, that reaches further than the rest in every direction
    along it, and with the rest on one side of it. The largest face of a box reaches no further than the box.

    Args:
        points: centred, of size about 1. sample: (M, 3), some of them in random order.
    """
    everything = np.ones(len(points), dtype=bool)
    sample = sample[:SAMPLE]
    if len(sample) < FEWEST:
        return everything
    found = _largest_plane(sample)
    if found is None:
        return everything
    normal, offset, thick = found
    heights = points @ normal - offset
    floor = np.abs(heights) <= thick
    rest = ~floor
    if rest.sum() < FEWEST or floor.mean() < SHARE:
        return everything
    upwards = (heights[rest] > 0).mean()
    if max(upwards, 1 - upwards) < ABOVE or not _reaches_further(points[floor], points[rest], normal):
        return everything
    return rest


def _largest_plane(sample: np.ndarray) -> tuple[np.ndarray, float, float] | None:
    """The plane that holds most of the sample: unit normal, offset, and how far from it its points are at most."""
    rng = np.random.default_rng(0)
    corners = sample[rng.integers(len(sample), size=(TRIPLES, 3))]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    normals = normals[lengths > 1e-4] / lengths[lengths > 1e-4, None]
    if not len(normals):
        return None
    offsets = (normals * corners[lengths > 1e-4, 0]).sum(1)
    within = np.abs(normals @ sample.T - offsets[:, None]) <= THICK
    best = int(within.sum(1).argmax())
    if within[best].mean() < SHARE:
        return None
    rows = within[best]
    for _ in range(2):
        centre = sample[rows].mean(0)
        normal = np.linalg.eigh(np.cov((sample[rows] - centre).T))[1][:, 0]
        heights = np.abs((sample - centre) @ normal)
        rows = heights <= THICK
        if rows.sum() < 10:
            return None
    return normal, float(centre @ normal), float(np.clip(5 * np.median(heights[rows]), 0.3 * THICK, 1.5 * THICK))


def _reaches_further(floor: np.ndarray, rest: np.ndarray, normal: np.ndarray) -> bool:
    """Whether the floor is wider than what stands on it along two axes of it, and that is no mere relief."""
    first = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    first /= np.linalg.norm(first)
    axes = np.stack([first, np.cross(normal, first)])
    flat, above = floor @ axes.T, rest @ axes.T
    turned = np.linalg.eigh(np.cov(above.T))[1]
    flat, above = flat @ turned, above @ turned
    wide, width = (np.ptp(np.quantile(each, (0.01, 0.99), axis=0), axis=0) for each in (flat, above))
    height = np.ptp(np.quantile(rest @ normal, (0.01, 0.99)))
    return bool((wide > WIDER * width).all() and wide.prod() > LARGER * width.prod() and height > HIGH * width.max())
