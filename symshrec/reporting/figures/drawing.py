"""Figure 2's way of showing a cloud: its points with translucent mirror planes through them, seen in parallel."""

from dataclasses import dataclass
from itertools import product

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb, to_rgba

from symshrec.planes import Planes

POINTS, TRUE, PREDICTED = "#1c2331", "#0072b2", "#d55e00"  # the planes' blue and vermilion: safe for the colour-blind
CORNERS = np.array(list(product((0, 1), repeat=3)))
EDGES = np.array([(i, j) for i in range(8) for j in range(i) if np.abs(CORNERS[i] - CORNERS[j]).sum() == 1])
MARGIN = 0.06  # how far the planes stand out of the cloud's box, as a share of its longest side


@dataclass(frozen=True)
class View:
    """A parallel projection, looking at the cloud from azimuth and elevation in degrees; z points up."""

    azimuth: float = 28.0
    elevation: float = 40.0

    @property
    def axes(self) -> np.ndarray:
        """(3, 3): the directions right, up and towards the viewer as rows."""
        a, e = np.radians([self.azimuth, self.elevation])
        right = [-np.sin(a), np.cos(a), 0.0]
        up = [-np.sin(e) * np.cos(a), -np.sin(e) * np.sin(a), np.cos(e)]
        return np.array([right, up, np.cross(right, up)])


def box(points: np.ndarray, margin: float = MARGIN) -> np.ndarray:
    """Least and greatest corner, (2, 3), of the axis-aligned box of (N, 3) points, widened on every side."""
    low, high = np.min(points, axis=0), np.max(points, axis=0)
    return np.stack([low, high]) + np.outer([-1, 1], np.full(3, margin * np.max(high - low)))


def clip_plane(normal: np.ndarray, point: np.ndarray, bounds: np.ndarray) -> np.ndarray:
    """The part of a plane inside a box as a convex polygon.

    Args:
        normal: (3,), unit.
        point: (3,), on the plane.
        bounds: (2, 3), the box's least and greatest corner.

    Returns:
        (V, 3) corners in order around the polygon; V = 0 where the plane misses the box.
    """
    corners = bounds[0] + CORNERS * (bounds[1] - bounds[0])
    heights = (corners - point) @ normal
    starts, ends = heights[EDGES[:, 0]], heights[EDGES[:, 1]]
    cut = (starts <= 0) != (ends <= 0)
    if not cut.any():
        return np.zeros((0, 3))
    share = (starts[cut] / (starts[cut] - ends[cut]))[:, None]
    vertices = corners[EDGES[cut, 0]] * (1 - share) + corners[EDGES[cut, 1]] * share
    first = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    offsets = vertices - vertices.mean(axis=0)
    angles = np.arctan2(offsets @ np.cross(normal, first), offsets @ first)
    return vertices[np.argsort(angles)]


def draw_cloud(
    ax: Axes,
    points: np.ndarray,
    planes: Planes | None = None,
    predicted: Planes | None = None,
    *,
    title: str = "",
    view: View | None = None,
    limit: int = 5000,
    size: float = 2.2,
) -> None:
    """Draw a cloud with its true planes (blue) and predicted planes (vermilion) on ordinary 2D axes.

    Nearer points are darker, and points behind a plane take on its colour, so that depth can be read.

    Args:
        points: (N, 3); at most `limit` of them, evenly spread over their order, are drawn.
        size: of a point, in typographic points squared.

    Raises:
        ValueError: for an empty cloud or another shape.
    """
    points = np.asarray(points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3 or not len(points):
        raise ValueError(f"a cloud to draw has shape (N, 3) with N ≥ 1, not {points.shape}")
    bounds, directions = box(points), (view or View()).axes
    shown = points[np.linspace(0, len(points) - 1, min(limit, len(points))).astype(int)]
    shown = shown[np.argsort(shown @ directions[2])]
    depth = shown @ directions[2]
    colours = np.array(to_rgb(POINTS)) + np.outer(0.42 * (depth.max() - depth) / max(np.ptp(depth), 1e-9), np.ones(3))
    outlines = []
    for layer, colour, strength in ((planes, TRUE, 1.0), (predicted, PREDICTED, 0.5)):
        if layer is None or not len(layer):
            continue
        alpha = (0.03 + 0.17 / len(layer)) * strength
        behind = _planes_in_front(shown, layer, bounds, directions[2])
        colours += (1 - (1 - 1.6 * alpha) ** behind)[:, None] * (np.array(to_rgb(colour)) - colours)
        outlines += _draw_planes(ax, layer, bounds, directions, colour, alpha)
    flat = shown @ directions[:2].T
    ax.scatter(flat[:, 0], flat[:, 1], s=size, c=np.clip(colours, 0, 1), linewidths=0, zorder=2)
    drawn = np.concatenate([flat, *outlines])
    low, high = drawn.min(axis=0), drawn.max(axis=0)
    half = max(0.51 * (high - low).max(), 1e-6)
    (left, bottom), (right, top) = (low + high) / 2 - half, (low + high) / 2 + half
    ax.set(xlim=(left, right), ylim=(bottom, top), aspect="equal")
    ax.set_axis_off()
    if title:
        ax.set_title(title, fontsize=11)


def _draw_planes(
    ax: Axes, planes: Planes, bounds: np.ndarray, directions: np.ndarray, colour: str, alpha: float
) -> list[np.ndarray]:
    """Draw the planes' parts inside the box and give their projected outlines, each (V, 2)."""
    polygons = [clip_plane(n, p, bounds) @ directions[:2].T for n, p in zip(planes.normals, planes.points, strict=True)]
    polygons = [polygon for polygon in polygons if len(polygon)]
    edge = to_rgba(colour, min(0.9, 0.35 + 0.5 / max(len(polygons), 1)))
    ax.add_collection(
        PolyCollection(polygons, facecolors=[to_rgba(colour, alpha)], edgecolors=[edge], linewidths=0.9, zorder=1)
    )
    return polygons


def _planes_in_front(points: np.ndarray, planes: Planes, bounds: np.ndarray, towards: np.ndarray) -> np.ndarray:
    """How many of the clipped planes lie between each of (N, 3) points and the viewer: (N,)."""
    slope = planes.normals @ towards  # (K,)
    heights = points @ planes.normals.T - planes.offsets  # (N, K)
    distance = -heights / np.where(np.abs(slope) < 1e-9, np.inf, slope)
    crossing = points[:, None] + distance[:, :, None] * towards  # (N, K, 3)
    return ((distance > 0) & ((crossing >= bounds[0]) & (crossing <= bounds[1])).all(axis=2)).sum(axis=1)
