"""The triangles of a mesh as pixels: which one is in front in each."""

import numpy as np

from symshrec.reporting.figures.raster import NOTHING, Canvas

AT_ONCE = 4_000_000  # pixels of triangles that memory holds at a time, unless one triangle has more


def rasterised(canvas: Canvas, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Depths (size, size), -∞ where no triangle is, and the places (size, size) of the triangles in front, else -1.

    Every pixel whose centre a triangle covers is its own: triangles that share an edge leave no gap.

    Args:
        corners: (F, 3, 3).
    """
    flat, depths = canvas.pixels(corners.reshape(-1, 3))
    flat, depths = flat.reshape(-1, 3, 2), depths.reshape(-1, 3)
    depth, front = np.full(canvas.size**2, NOTHING), np.full(canvas.size**2, -1)
    sides = np.ceil(np.ptp(flat, axis=1)) + 1
    blocks = (np.cumsum(sides.prod(axis=1)) // AT_ONCE).astype(int)
    for rows in np.split(np.arange(len(flat)), np.flatnonzero(np.diff(blocks)) + 1):
        triangles, pixels, near = _pixels(flat[rows], depths[rows], canvas.size)
        np.maximum.at(depth, pixels, near)
        first = near == depth[pixels]
        front[pixels[first]] = rows[triangles[first]]
    return depth.reshape(canvas.size, -1), front.reshape(canvas.size, -1)


def _pixels(flat: np.ndarray, depths: np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The triangle, the pixel and the depth, (n,) each, of all pixels in triangles (F, 3, 2)."""
    top, bottom = np.ceil(flat[..., 1].min(axis=1)).clip(0), np.floor(flat[..., 1].max(axis=1)).clip(max=size - 1)
    triangles, y = _counted(top, bottom)
    left, right = np.full(len(y), np.inf), np.full(len(y), -np.inf)
    for here, after in ((0, 1), (1, 2), (2, 0)):
        (x0, y0), (x1, y1) = flat[triangles, here].T, flat[triangles, after].T
        crossed = (np.minimum(y0, y1) <= y) & (y <= np.maximum(y0, y1)) & (y0 != y1)
        x = x0 + (x1 - x0) * (y - y0) / np.where(y0 == y1, 1, y1 - y0)
        left, right = np.where(crossed, np.minimum(left, x), left), np.where(crossed, np.maximum(right, x), right)
    spans, x = _counted(np.ceil(left).clip(0), np.floor(right).clip(max=size - 1))
    triangles, y = triangles[spans], y[spans]
    (ax, ay), (bx, by) = (flat[:, 1] - flat[:, 0]).T, (flat[:, 2] - flat[:, 0]).T
    a, b = (depths[:, 1:] - depths[:, :1]).T
    area = ax * by - ay * bx
    seen = np.abs(area) > np.finfo(float).eps * size  # not from the edge
    area = np.where(seen, area, 1)
    along, down = (a * by - b * ay) / area, (b * ax - a * bx) / area
    near = depths[triangles, 0]
    near = near + along[triangles] * (x - flat[triangles, 0, 0]) + down[triangles] * (y - flat[triangles, 0, 1])
    near = near.clip(depths.min(axis=1)[triangles], depths.max(axis=1)[triangles])
    kept = seen[triangles]
    return triangles[kept], (y * size + x)[kept].astype(np.int64), near[kept]


def _counted(first: np.ndarray, last: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of (R,) ranges of whole numbers, the range and the number, (n,) each; empty where the last is below the first."""
    counts = np.maximum(0, np.where(np.isfinite(first) & np.isfinite(last), last - first + 1, 0)).astype(np.int64)
    rows = np.repeat(np.arange(len(counts)), counts)
    return rows, first[rows] + np.arange(len(rows)) - np.repeat(np.cumsum(counts) - counts, counts)
