"""What `symshrec detect` found, as a picture: numbered planes through a shape, or its deviation from a mirror image."""

from io import BytesIO

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from symshrec.planes.wording import headline
from symshrec.reporting.figures.outlines import round_length, view_of
from symshrec.reporting.figures.raster import Canvas, Pane, render
from symshrec.reporting.figures.shading import DIVERGING, shaded
from symshrec.reporting.figures.subject import MANY, Subject

SAMPLED = 2  # pixels that are drawn for each of the picture, across and down
POINT = 0.6  # of a point's radius, as a share of what lies between neighbours
FEW = 8  # planes whose numbers are large


def picture(subject: Subject, *, side: float = 6.0, dpi: int = 200) -> bytes:
    """A png: the shape with its planes in their colours and numbers, a scale bar and the axes' directions.

    Args:
        side: of the picture in inches; a colour bar is added to its width.
    """
    view, pixels = view_of(subject.planes[subject.shown]), round(side * dpi)
    outlines = [subject.outline(row) for row in subject.shown]
    ends = subject.axis
    extra = [] if ends is None else [ends]
    fine = SAMPLED if len(outlines) <= MANY else 1
    canvas = Canvas.around(view, np.concatenate([subject.points, *outlines, *extra]), fine * pixels)
    panes = [Pane(each, subject.colour(row), subject.alpha) for each, row in zip(outlines, subject.shown, strict=True)]
    image = render(canvas, *shaded(subject, canvas, POINT), panes)
    image = image.reshape(pixels, fine, pixels, fine, 3).mean(axis=(1, 3))
    wide = side * (1.22 if subject.deviations is not None else 1)
    figure, content = Figure((wide, side)), BytesIO()
    ax = figure.add_axes((0, 0, side / wide, 1))
    ax.imshow(image, extent=(0, 1, 0, 1), interpolation="antialiased")
    ax.set(xlim=(0, 1), ylim=(0, 1))
    ax.set_axis_off()
    if ends is not None:
        (a, b) = _relative(canvas, ends)
        ax.plot([a[0], b[0]], [a[1], b[1]], color="black", lw=1.2, dashes=(8, 3, 1.5, 3))
    _number(ax, canvas, subject, dict(zip(subject.shown, outlines, strict=True)))
    if subject.group is not None:
        ax.text(0.02, 0.98, headline(subject.group), ha="left", va="top", fontsize=10)
    _scale_bar(ax, canvas)
    _axes_triad(ax, canvas)
    if subject.deviations is not None:
        _colour_bar(figure, subject, side / wide)
    figure.savefig(content, format="png", dpi=dpi, metadata={"Software": None})
    return content.getvalue()


def _relative(canvas: Canvas, places: np.ndarray) -> np.ndarray:
    """Places (N, 3) in the picture, (N, 2) from 0 to 1 from the lower left."""
    pixels = (canvas.pixels(places)[0] + 0.5) / canvas.size
    return np.stack([pixels[:, 0], 1 - pixels[:, 1]], axis=1)


def _number(ax: Axes, canvas: Canvas, subject: Subject, outlines: dict[int, np.ndarray]) -> None:
    """Every plane's number by the corner of it that is farthest from those already numbered and from the middle."""
    taken: list[np.ndarray] = []
    rows = [row for row in outlines if subject.numbered(row)]
    for row in rows:
        corners = outlines[row]
        inner = corners + 0.05 * (corners.mean(axis=0) - corners)
        places = _relative(canvas, inner)
        room = [min([0.25, *(float(np.linalg.norm(each - other)) for other in taken)]) for each in places]
        out = np.linalg.norm(places - 0.5, axis=1)
        place = places[int(np.argmax(np.array(room) + 0.3 * out))]
        taken.append(place)
        ax.text(
            place[0],
            place[1],
            str(row + 1),
            color="white",
            fontsize=11 if len(rows) <= FEW else 8,
            fontweight="bold",
            ha="center",
            va="center",
            bbox={"boxstyle": "circle,pad=0.22", "facecolor": subject.colour(row), "edgecolor": "white", "lw": 0.8},
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


def _colour_bar(figure: Figure, subject: Subject, left: float) -> None:
    ax = figure.add_axes((left + 0.02, 0.14, 0.028, 0.72))
    scale = ScalarMappable(Normalize(-subject.limit, subject.limit), DIVERGING)
    bar = figure.colorbar(scale, cax=ax, extend="both", extendfrac=0.03)
    bar.set_label(f"distance from the mirror image in plane {subject.number}", fontsize=10)
    bar.outline.set_linewidth(0.5)
    bar.ax.tick_params(labelsize=9)
