"""What `symshrec detect` found, as a web page that turns under the mouse and needs no network."""

from html import escape

import numpy as np
from matplotlib.ticker import MaxNLocator

from symshrec.planes.wording import headline
from symshrec.reporting.figures.outlines import round_length, view_of
from symshrec.reporting.figures.shading import DIVERGING, GREY
from symshrec.reporting.figures.subject import MAPPED, Subject

SHOWN = 20_000  # points of a larger cloud, evenly spread over its order
CLOSE, FAINTEST = 0.95, 0.06  # how near the page looks from at first; least opacity of a plane
WHOLE_WINDOW = "<style>body { margin: 0; overflow: hidden }</style>"
SOLID, PLAIN = "rgb({},{},{})".format(*np.round(255 * GREY).astype(int)), "#3b4252"
AXIS = {"showbackground": False, "gridcolor": "#e5e7eb", "zeroline": False, "showspikes": False, "color": "#555"}


def cloud_page(subject: Subject, title: str = "", deviations: np.ndarray | None = None) -> str:
    """One self-contained html page of about 5 MB, nearly all of it plotly's own script.

    Faces are drawn where there are some. Each plane has the colour and number that it has in the table, is cut to the
    shape's extent, and can be hidden by a click on its line in the legend. The axes have the file's own coordinates,
    and a bar of a round length lies below the shape.

    Args:
        deviations: (K, N), of the points from their mirror images: a menu shows them, one plane's at a time.

    Raises:
        ModuleNotFoundError: without plotly, the extra `plot`.
    """
    import plotly.graph_objects as go

    points = np.asarray(subject.points, dtype=np.float64)
    origin = points.mean(axis=0)
    figure = go.Figure([*_shape(go, subject, points, origin), *_deviations(go, subject, points, origin, deviations)])
    names = [_name(subject, row) for row in range(len(subject.planes))]
    for row, name in enumerate(names):
        figure.add_traces(_plane_traces(go, subject, row, origin, first=names.index(name) == row))
    figure.add_traces(_lines(go, subject, points, origin))
    towards = view_of(subject.planes).axes[2]
    figure.update_layout(
        title={"text": _heading(title, subject), "x": 0.01},
        template="plotly_white",
        margin={"l": 0, "r": 0, "b": 0, "t": 64},
        legend={"x": 0.01, "y": 0.98, "itemsizing": "constant"},
        updatemenus=_menu(figure, subject, deviations),
        scene={
            "aspectmode": "data",
            **{f"{name}axis": _ticks(points[:, axis], origin[axis], name) for axis, name in enumerate("xyz")},
            "camera": {"projection": {"type": "orthographic"}, "eye": dict(zip("xyz", CLOSE * towards, strict=True))},
        },
    )
    page = figure.to_html(include_plotlyjs=True, default_height="100vh", config={"displaylogo": False})
    return page.replace("<head>", f"<head><title>{escape(title)}</title>{WHOLE_WINDOW}", 1)


def _heading(title: str, subject: Subject) -> str:
    """The file's name, and below it the planes' group."""
    below = "" if subject.group is None else f"<br><sup>{escape(headline(subject.group))}</sup>"
    return escape(title) + below


def _some(points: np.ndarray) -> np.ndarray:
    return np.linspace(0, len(points) - 1, min(SHOWN, len(points))).astype(int)


def _shape(go, subject: Subject, points: np.ndarray, origin: np.ndarray) -> list:
    """The faces of a mesh, or the points of a cloud."""
    if subject.mesh is not None:
        corners = dict(zip("ijk", subject.mesh.triangles.astype(np.int32).T, strict=True))
        look = {"ambient": 0.55, "diffuse": 0.7, "specular": 0.05, "facenormalsepsilon": 0, "vertexnormalsepsilon": 0}
        name = f"{len(subject.mesh.triangles):,} triangles"
        mesh = _coordinates(subject.mesh.vertices, origin)
        return [go.Mesh3d(**mesh, **corners, color=SOLID, flatshading=True, lighting=look, name=name, hoverinfo="skip",
                          showlegend=True)]  # fmt: skip
    marker = {"size": 1.6, "color": PLAIN}
    name = f"{len(points):,} points"
    some = _coordinates(points[_some(points)], origin)
    return [go.Scatter3d(**some, mode="markers", marker=marker, name=name, hoverinfo="skip")]


def _deviations(go, subject: Subject, points: np.ndarray, origin: np.ndarray, deviations: np.ndarray | None) -> list:
    """The points in the colours of their deviation, hidden until the menu shows them; a trace for each plane."""
    traces, some = [], _some(points)
    for row, values in enumerate([] if deviations is None else deviations[:MAPPED]):
        limit = Subject(points, subject.planes, deviations=values).limit
        bar = {"title": {"text": f"distance from the mirror image in plane {row + 1}", "side": "right"}, "len": 0.7}
        marker = {"size": 2.2, "color": values[some].astype(np.float32), "cmin": -limit, "cmax": limit}
        marker |= {"colorscale": DIVERGING.removesuffix("_r"), "reversescale": True, "colorbar": bar}
        place = _coordinates(points[some], origin)
        traces.append(
            go.Scatter3d(
                **place,
                mode="markers",
                marker=marker,
                name=f"deviation {row + 1}",
                visible=False,
                showlegend=False,
                hovertemplate="%{marker.color:.4g}<extra></extra>",
            )
        )
    return traces


def _menu(figure, subject: Subject, deviations: np.ndarray | None) -> list[dict]:
    """A choice between the bare shape and the deviations to one of the planes."""
    count = 0 if deviations is None else len(deviations[:MAPPED])
    if not count:
        return []
    labels = ["shape", *(f"deviation from plane {row + 1}" for row in range(count))]
    buttons = [
        {"label": label, "method": "restyle", "args": [{"visible": [place == row for row in range(count + 1)]},
                                                      list(range(count + 1))]}
        for place, label in enumerate(labels)
    ]  # fmt: skip
    return [{"buttons": buttons, "x": 0.99, "xanchor": "right", "y": 0.99, "yanchor": "top"}]


def _plane_traces(go, subject: Subject, row: int, origin: np.ndarray, first: bool) -> list:
    """A translucent rectangle, its edge, and its number; `first` of those that share a line of the legend."""
    corners, colour, name = subject.outline(row), subject.colour(row), _name(subject, row)
    shared = {"name": name, "legendgroup": name}
    place = _coordinates(corners, origin)
    ring = _coordinates(np.concatenate([corners, corners[:1]]), origin)
    flat = {"ambient": 1.0, "diffuse": 0.0}
    shade = {"color": colour, "opacity": max(subject.alpha, FAINTEST), "lighting": flat, "hoverinfo": "name"}
    face = go.Mesh3d(**place, i=[0, 0], j=[1, 2], k=[2, 3], **shade, **shared)
    edge = go.Scatter3d(**ring, mode="lines", line={"color": colour, "width": 4}, hoverinfo="skip",
                        showlegend=first, **shared)  # fmt: skip
    if not subject.numbered(row):
        return [face, edge]
    corner = _coordinates(corners[:1], origin)
    number = go.Scatter3d(**corner, mode="text", text=[f"<b>{row + 1}</b>"], textfont={"color": colour, "size": 18},
                          showlegend=False, hoverinfo="skip", **shared)  # fmt: skip
    return [face, edge, number]


def _name(subject: Subject, row: int) -> str:
    """A plane's line in the legend; those of a surface of revolution share one."""
    if subject.numbered(row):
        return f"plane {row + 1}, confidence {subject.planes.confidences[row]:.2f}"
    count = sum(not subject.numbered(each) and subject.colour(each) == subject.colour(row)
                for each in range(len(subject.planes)))  # fmt: skip
    return f"{count} planes of the axis" if count > 1 else "the plane across the axis"


def _lines(go, subject: Subject, points: np.ndarray, origin: np.ndarray) -> list:
    """The scale bar, and the axis of a surface of revolution."""
    low, high = points.min(axis=0), points.max(axis=0)
    axis = int(np.argmax((high - low)[:2]))
    length = round_length(0.4 * (high - low)[axis] or 1.0)
    start = low - 0.1 * (high - low).max() * np.array([1, 1, 0.6])
    ends = np.stack([start, start + length * np.eye(3)[axis]])
    bar = go.Scatter3d(
        **_coordinates(np.insert(ends, 1, ends.mean(axis=0), axis=0), origin),
        mode="lines+text",
        text=["", f"{length:g}", ""],
        textposition="bottom center",
        line={"color": "black", "width": 8},
        name="scale, in the file's unit",
        hoverinfo="skip",
    )
    if subject.axis is None:
        return [bar]
    line = {"color": "black", "width": 4, "dash": "dashdot"}
    axis_line = _coordinates(subject.axis, origin)
    return [bar, go.Scatter3d(**axis_line, mode="lines", line=line, name=subject.axis_name)]


def _ticks(values: np.ndarray, origin: float, name: str) -> dict:
    """An axis whose labels are the file's coordinates, though the page holds them about an origin."""
    places = np.asarray(MaxNLocator(5, steps=[1, 2, 5, 10]).tick_values(values.min(), values.max()))
    texts = [f"{value + 0.0:.10g}" for value in np.round(places, 12)]
    return {**AXIS, "title": {"text": name}, "tickvals": (places - origin).tolist(), "ticktext": texts}


def _coordinates(points: np.ndarray, origin: np.ndarray) -> dict[str, np.ndarray]:
    """x, y and z about an origin, in single precision: half the page, and what WebGL draws in anyway."""
    return dict(zip("xyz", (points - origin).astype(np.float32).T, strict=True))
