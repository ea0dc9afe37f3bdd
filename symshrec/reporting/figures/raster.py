"""A picture of points or faces with translucent planes between them, each pixel in its true order of depth."""

from dataclasses import dataclass

import numpy as np
from matplotlib.colors import to_rgb

from symshrec.reporting.figures.drawing import View

RELIEF = 0.55  # how dark a pixel is that lies much deeper than those around it
STEPS = ((1, 0), (-1, 0), (0, 1), (0, -1), (2, 2), (-2, 2), (2, -2), (-2, -2))
EDGE_ALPHA, HIDDEN_ALPHA = 0.9, 0.16  # of a plane's edge, seen and behind the shape
FULL = 0.05  # how much a plane hides from which its edge is drawn in full
NOTHING = -np.inf


@dataclass(frozen=True, eq=False)
class Pane:
    """A plane to draw: its convex corners (V, 3) in order, its colour, and how much it hides."""

    corners: np.ndarray
    colour: str
    alpha: float


@dataclass(frozen=True, eq=False)
class Canvas:
    """A square of size × size pixels that looks at a scene: `view`, its middle (2,) and half its side in the unit."""

    view: View
    middle: np.ndarray
    half: float
    size: int

    @classmethod
    def around(cls, view: View, places: np.ndarray, size: int, margin: float = 0.06) -> "Canvas":
        """One that shows all of (N, 3) places."""
        flat = places @ view.axes[:2].T
        low, high = flat.min(axis=0), flat.max(axis=0)
        return cls(view, (low + high) / 2, max((0.5 + margin) * float((high - low).max()), 1e-12), size)

    def pixels(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Columns and rows (N, 2) from the upper left, not rounded, and depths (N,), greater where nearer."""
        flat = (places @ self.view.axes[:2].T - self.middle) / self.half
        return (flat * [1, -1] + 1) / 2 * self.size - 0.5, places @ self.view.axes[2]

    def places(self, depth: np.ndarray) -> np.ndarray:
        """What is seen in every pixel at depths (size, size): (size, size, 3)."""
        return np.stack([*np.broadcast_arrays(*self.grid), depth], axis=-1) @ self.view.axes

    @property
    def grid(self) -> tuple[np.ndarray, np.ndarray]:
        """How far right (1, size) and up (size, 1) the pixels' centres are."""
        steps = self.half * ((np.arange(self.size) + 0.5) / self.size * 2 - 1)
        return self.middle[0] + steps[None, :], self.middle[1] - steps[:, None]


def render(canvas: Canvas, depth: np.ndarray, image: np.ndarray, panes: list[Pane]) -> np.ndarray:
    """The picture (size, size, 3), from 0 to 1.

    Args:
        depth: (size, size) of the shape, -∞ beside it. image: (size, size, 3), its colours.
    """
    image, there = image.copy(), np.isfinite(depth)
    image[there] *= _relief(depth, canvas.half)[there][:, None]
    layers = [(_plane_depth(canvas, pane), np.array(to_rgb(pane.colour)), pane.alpha) for pane in panes]
    if layers:
        depths = np.stack([each for each, _, _ in layers])
        for rank in np.argsort(depths, axis=0):  # from the back to the front, pixel by pixel
            near = np.take_along_axis(depths, rank[None], axis=0)[0]
            alpha = np.array([each for _, _, each in layers])[rank] * (near > depth)
            colour = np.array([each for _, each, _ in layers])[rank]
            image += alpha[..., None] * (colour - image)
    for pane in panes:
        _edge(canvas, pane, depth, image)
    return image.clip(0, 1)


def splat(canvas: Canvas, points: np.ndarray, colours: np.ndarray, radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Depths (size, size), -∞ where nothing is, and colours (size, size, 3) on white, of discs, the nearest in front.

    Args:
        points: (N, 3). colours: (N, 3). radius: of a disc, in pixels.
    """
    places, depths = canvas.pixels(points)
    order = np.argsort(depths)  # so that of two in one pixel the nearer is written last
    places, depths, colours = np.round(places[order]).astype(int), depths[order], colours[order]
    depth, image = np.full((canvas.size, canvas.size), NOTHING), np.ones((canvas.size, canvas.size, 3))
    reach = int(np.ceil(radius))
    for right in range(-reach, reach + 1):
        for down in range(-reach, reach + 1):
            if right**2 + down**2 > radius**2 + 0.3:
                continue
            x, y = places[:, 0] + right, places[:, 1] + down
            shown = (x >= 0) & (y >= 0) & (x < canvas.size) & (y < canvas.size)
            x, y, near, colour = x[shown], y[shown], depths[shown], colours[shown]
            nearer = near > depth[y, x]
            depth[y[nearer], x[nearer]], image[y[nearer], x[nearer]] = near[nearer], colour[nearer]
    return depth, image


def _relief(depth: np.ndarray, half: float) -> np.ndarray:
    """Eye-dome lighting (Boucheny 2009): the share of light where neighbours lie nearer, (size, size)."""
    shade, filled = np.zeros_like(depth), np.where(np.isfinite(depth), depth, -1e300)
    for down, right in STEPS:
        nearer = np.roll(filled, (down, right), (0, 1)) - filled
        shade += np.clip(nearer / (0.06 * half), 0, 1) * (nearer < 1e299)
    return 1 - RELIEF * np.minimum(1, shade / len(STEPS) * 2)


def _plane_depth(canvas: Canvas, pane: Pane) -> np.ndarray:
    """Depths (size, size) of a pane, -∞ beside it; of a plane seen from its edge nowhere."""
    missing = np.full((canvas.size, canvas.size), NOTHING)
    normal = np.cross(pane.corners[1] - pane.corners[0], pane.corners[2] - pane.corners[1])
    length = np.linalg.norm(normal)
    right, up, towards = canvas.view.axes
    if length == 0 or abs(normal @ towards) < 1e-3 * length:
        return missing
    x, y = canvas.grid
    depth = (normal @ pane.corners[0] - x * (normal @ right) - y * (normal @ up)) / (normal @ towards)
    inside = np.ones(depth.shape, dtype=bool)
    flat = pane.corners @ np.stack([right, up], axis=1)
    for (ax, ay), (bx, by) in zip(flat, np.roll(flat, -1, axis=0), strict=True):
        inside &= ((bx - ax) * (y - ay) - (by - ay) * (x - ax)) * np.sign(normal @ towards) >= 0
    return np.where(inside, depth, missing)


def _edge(canvas: Canvas, pane: Pane, depth: np.ndarray, image: np.ndarray) -> None:
    """Draw a pane's edge over an image, faint where it is behind the shape."""
    ends = np.roll(pane.corners, -1, axis=0)
    share = np.linspace(0, 1, 2 * canvas.size)[:, None, None]
    along = (pane.corners * (1 - share) + ends * share).reshape(-1, 3)
    places, depths = canvas.pixels(along)
    wide = max(1, round(canvas.size / 900))
    offsets = range(-(wide // 2), wide - wide // 2)
    places = np.concatenate([np.round(places).astype(int) + np.array([a, b]) for a in offsets for b in offsets])
    places, first = np.unique(places, axis=0, return_index=True)
    near = np.tile(depths, len(offsets) ** 2)[first]
    shown = ((places >= 0) & (places < canvas.size)).all(axis=1)
    x, y = places[shown].T
    faint = min(1.0, pane.alpha / FULL)
    alpha = faint * np.where(near[shown] >= depth[y, x] - 1e-3 * canvas.half, EDGE_ALPHA, HIDDEN_ALPHA)[:, None]
    image[y, x] += alpha * (np.array(to_rgb(pane.colour)) - image[y, x])
