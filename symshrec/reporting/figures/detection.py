"""What `symshrec detect` found, as a picture: numbered planes through a shape, or its deviation from a mirror image."""

from dataclasses import dataclass
from io import BytesIO

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from scipy.spatial import cKDTree

from symshrec.planes import Planes, PointGroup
from symshrec.reporting.figures.outlines import outline, round_length, view_of
from symshrec.reporting.figures.raster import Canvas, Pane, render
from symshrec.scans.meshes import sample_surface
from symshrec.scans.palette import colour_code
from symshrec.scans.polygons import Mesh

GREY = np.array([0.62, 0.65, 0.7])
DIVERGING = "RdBu_r"
SPLATS = 600_000  # points that a mesh's faces are drawn as
MANY = 12  # planes from which they are drawn faint and without numbers
SAMPLED, PIXELS = 2, 1100  # pixels of the picture, and of those drawn for each
RANGE = 0.99  # share of the points whose deviation the colour bar spans
LIGHT = np.array([0.25, 0.55, 0.8]) / np.linalg.norm([0.25, 0.55, 0.8])  # towards it: right, up and to the viewer


@dataclass(frozen=True, eq=False)
class Found:
    """What there is to draw.

    Attributes:
        points: (N, 3), that planes were found on. mesh: that they are of, None of a cloud. planes: by number.
        group: of the planes; its axis is drawn where it is a surface of revolution.
        deviations: (N,), signed, of the points from the mirror image in the plane `number`; None: all in grey.
    """

    points: np.ndarray
    planes: Planes
    mesh: Mesh | None = None
    group: PointGroup | None = None
    deviations: np.ndarray | None = None
    number: int = 1

    @property
    def shown(self) -> list[int]:
        """Places of the planes that are drawn: the one that deviations are to, or all."""
        return list(range(len(self.planes))) if self.deviations is None else [self.number - 1]

    @property
    def limit(self) -> float:
        """The deviation at either end of the colour bar."""
        most = 0.0 if self.deviations is None else float(np.quantile(np.abs(self.deviations), RANGE))
        return most or 1e-12

    def outline(self, row: int) -> np.ndarray:
        """A plane's rectangle (4, 3)."""
        return outline(self.points, self.planes.normals[row], self.planes.points[row])

    @property
    def alpha(self) -> float:
        """How much a plane hides: little where there are many, or where the colours of points are to be read."""
        return 0.06 if self.deviations is not None else 0.22 if len(self.planes) <= MANY else 1.0 / len(self.planes)

    def colour(self, row: int) -> str:
        """A plane's own colour; of a surface of revolution, one for all that go through its axis."""
        if self.group is None or not self.group.continuous or row in self.group.outside:
            return colour_code(row + 1)
        axes = self.group.axes
        return colour_code(2 if axes and abs(self.planes.normals[row] @ axes[0].direction) > 0.5 else 1)

    @property
    def axis(self) -> np.ndarray | None:
        """The ends (2, 3) of a surface of revolution's axis, standing out a little; None of other shapes."""
        if self.group is None or not self.group.axes or not self.group.continuous:
            return None
        direction = self.group.axes[0].direction
        along = (self.points - self.group.centre) @ direction
        ends = np.array([along.min(), along.max()]) + np.array([-0.12, 0.12]) * np.ptp(along)
        return self.group.centre + ends[:, None] * direction


def picture(found: Found, *, side: float = 6.0, dpi: int = 200) -> bytes:
    """A png: the shape with its planes in their colours and numbers, a scale bar and the axes' directions.

    Args:
        side: of the picture in inches; a colour bar is added to its width.
    """
    view = view_of(found.planes[found.shown])
    outlines = [found.outline(row) for row in found.shown]
    ends = found.axis
    extra = [] if ends is None else [ends]
    fine = SAMPLED if len(outlines) <= MANY else 1
    canvas = Canvas.around(view, np.concatenate([found.points, *outlines, *extra]), fine * PIXELS)
    points, colours, spacing = _splats(found, canvas)
    radius = float(np.clip((0.5 if len(outlines) <= MANY else 0.8) * spacing / (2 * canvas.half) * canvas.size, 1, 9))
    numbers = [row + 1 for row in found.shown]
    panes = [Pane(each, found.colour(row), found.alpha) for each, row in zip(outlines, found.shown, strict=True)]
    image = render(canvas, points, colours, radius, panes)
    image = image.reshape(PIXELS, fine, PIXELS, fine, 3).mean(axis=(1, 3))
    wide = side * (1.22 if found.deviations is not None else 1)
    figure, content = Figure((wide, side)), BytesIO()
    ax = figure.add_axes((0, 0, side / wide, 1))
    ax.imshow(image, extent=(0, 1, 0, 1), interpolation="antialiased")
    ax.set(xlim=(0, 1), ylim=(0, 1))
    ax.set_axis_off()
    if ends is not None:
        (a, b) = _relative(canvas, ends)
        ax.plot([a[0], b[0]], [a[1], b[1]], color="black", lw=1.2, dashes=(8, 3, 1.5, 3))
    if len(numbers) <= MANY and not (found.group and found.group.continuous):
        _number(ax, canvas, outlines, numbers)
    _scale_bar(ax, canvas)
    _axes_triad(ax, canvas)
    if found.deviations is not None:
        _colour_bar(figure, found, side / wide)
    figure.savefig(content, format="png", dpi=dpi, metadata={"Software": None})
    return content.getvalue()


def _splats(found: Found, canvas: Canvas) -> tuple[np.ndarray, np.ndarray, float]:
    """Points (n, 3) with colours (n, 3), and how far apart they are; of a mesh, many, and lit."""
    points, light = found.points, np.ones(len(found.points))
    if found.mesh is not None:
        corners = found.mesh.vertices[found.mesh.triangles]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        areas = np.linalg.norm(normals, axis=1)
        drawn, faces = sample_surface(corners, SPLATS, 0), _faces_of(areas, SPLATS)
        points = found.points if drawn is None else drawn
        normals = normals[faces] / np.maximum(areas[faces, None], 1e-300) @ canvas.view.axes.T
        normals *= np.where(normals[:, 2:] < 0, -1, 1)  # either side is lit alike
        light = 0.55 + 0.5 * np.maximum(0, normals @ LIGHT)
        spacing = np.sqrt(areas.sum() / 2 / SPLATS) * 1.5
    else:
        step = cKDTree(points).query(points[:: max(1, len(points) // 2000)], k=4)[0][:, -1] if len(points) > 3 else [0]
        spacing = float(np.median(step))
    if found.deviations is None:
        colours = np.tile(GREY, (len(points), 1))
    else:
        values = found.deviations if found.mesh is None else found.deviations[cKDTree(found.points).query(points)[1]]
        colours = colormaps[DIVERGING](0.5 + 0.5 * np.clip(values / found.limit, -1, 1))[:, :3]
        colours = 0.94 * colours
    return points, np.clip(colours * light[:, None], 0, 1), spacing


def _faces_of(areas: np.ndarray, count: int) -> np.ndarray:
    """Which triangle each of the points that `sample_surface` draws by seed 0 is on: (count,)."""
    total = np.cumsum(areas)
    places = (np.arange(count) + np.random.default_rng(0).random(count)) / count * total[-1]
    return np.searchsorted(total, places, side="right").clip(max=len(areas) - 1)


def _relative(canvas: Canvas, places: np.ndarray) -> np.ndarray:
    """Places (N, 3) in the picture, (N, 2) from 0 to 1 from the lower left."""
    pixels = (canvas.pixels(places)[0] + 0.5) / canvas.size
    return np.stack([pixels[:, 0], 1 - pixels[:, 1]], axis=1)


def _number(ax: Axes, canvas: Canvas, outlines: list[np.ndarray], numbers: list[int]) -> None:
    """Every plane's number by the corner of it that is farthest from those already numbered and from the middle."""
    taken: list[np.ndarray] = []
    for corners, number in zip(outlines, numbers, strict=True):
        inner = corners + 0.05 * (corners.mean(axis=0) - corners)
        places = _relative(canvas, inner)
        room = [min([0.25, *(float(np.linalg.norm(each - other)) for other in taken)]) for each in places]
        out = np.linalg.norm(places - 0.5, axis=1)
        place = places[int(np.argmax(np.array(room) + 0.3 * out))]
        taken.append(place)
        ax.text(
            place[0],
            place[1],
            str(number),
            color="white",
            fontsize=11,
            fontweight="bold",
            ha="center",
            va="center",
            bbox={"boxstyle": "circle,pad=0.22", "facecolor": colour_code(number), "edgecolor": "white", "lw": 0.8},
        )


def _scale_bar(ax: Axes, canvas: Canvas) -> None:
    """A round length at the lower right, in the file's unit."""
    length = round_length(0.25 * 2 * canvas.half)
    share = length / (2 * canvas.half)
    ax.plot([0.965 - share, 0.965], [0.035, 0.035], color="black", lw=2.2, solid_capstyle="butt")
    ax.text(0.965 - share / 2, 0.045, f"{length:g}", ha="center", va="bottom", fontsize=10)


def _axes_triad(ax: Axes, canvas: Canvas) -> None:
    """The directions of x, y and z at the lower left."""
    for name, (right, up) in zip("xyz", canvas.view.axes[:2].T, strict=True):
        start, way = np.array([0.085, 0.075]), 0.055 * np.array([right, up])
        if np.hypot(right, up) > 0.15:
            tip, tail = (start + way).tolist(), start.tolist()
            ax.annotate("", tip, tail, arrowprops={"arrowstyle": "-|>", "lw": 1.1, "color": "#444444"})
        ax.text(
            start[0] + 1.35 * way[0],
            start[1] + 1.35 * way[1],
            name,
            ha="center",
            va="center",
            fontsize=10,
            color="#444444",
        )


def _colour_bar(figure: Figure, found: Found, left: float) -> None:
    ax = figure.add_axes((left + 0.02, 0.14, 0.028, 0.72))
    scale = ScalarMappable(Normalize(-found.limit, found.limit), DIVERGING)
    bar = figure.colorbar(scale, cax=ax, extend="both", extendfrac=0.03)
    bar.set_label(f"distance from the mirror image in plane {found.number}", fontsize=10)
    bar.outline.set_linewidth(0.5)
    bar.ax.tick_params(labelsize=9)
