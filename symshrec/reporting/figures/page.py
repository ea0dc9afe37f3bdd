"""A cloud and its planes as a web page that turns under the mouse and needs no network."""

from html import escape

import numpy as np

from symshrec.planes import Planes
from symshrec.reporting.figures.drawing import POINTS, PREDICTED, box, clip_plane

SHOWN = 20_000  # points of a larger cloud, evenly spread over its order
OPACITY = 0.25
WHOLE_WINDOW = "<style>body { margin: 0; overflow: hidden }</style>"


def cloud_page(points: np.ndarray, planes: Planes, title: str = "") -> str:
    """One self-contained html page of about 5 MB, nearly all of it plotly's own script.

    Each plane is cut to the cloud's box, and can be hidden by a click on its line in the legend.

    Args:
        points: (N, 3), any unit and position.
        planes: of the cloud, in its coordinates; named by their place and confidence.

    Raises:
        ModuleNotFoundError: without plotly, the extra `plot`.
    """
    import plotly.graph_objects as go

    points = np.asarray(points, dtype=np.float64)
    origin, bounds = points.mean(axis=0), box(points)
    shown = points[np.linspace(0, len(points) - 1, min(SHOWN, len(points))).astype(int)]
    cloud = go.Scatter3d(
        **_coordinates(shown, origin),
        mode="markers",
        marker={"size": 1.4, "color": POINTS},
        name=f"{len(points):,} points",
        hoverinfo="skip",
    )
    figure = go.Figure([cloud])
    for number, (normal, point, confidence) in enumerate(
        zip(planes.normals, planes.points, planes.confidences, strict=True), 1
    ):
        outline = clip_plane(normal, point, bounds)
        if len(outline):
            figure.add_traces(_plane_traces(go, outline, origin, f"plane {number}, confidence {confidence:.2f}"))
    hidden = {"visible": False}
    figure.update_layout(
        title={"text": escape(title)},
        template="plotly_white",
        margin={"l": 0, "r": 0, "b": 0, "t": 48},
        legend={"x": 0.01, "y": 0.99, "itemsizing": "constant"},
        scene={
            "aspectmode": "data",
            **{f"{axis}axis": hidden for axis in "xyz"},
            "camera": {"projection": {"type": "orthographic"}, "eye": {"x": 1.2, "y": 0.6, "z": 1.0}},
        },
    )
    page = figure.to_html(include_plotlyjs=True, default_height="100vh", config={"displaylogo": False})
    return page.replace("<head>", f"<head><title>{escape(title)}</title>{WHOLE_WINDOW}", 1)


def _plane_traces(go, outline: np.ndarray, origin: np.ndarray, name: str) -> list:
    """A translucent polygon (V, 3), cut into triangles around its first corner, and its edge."""
    corners = np.arange(1, len(outline) - 1)
    face = go.Mesh3d(
        **_coordinates(outline, origin),
        i=np.zeros(len(corners), int),
        j=corners,
        k=corners + 1,
        color=PREDICTED,
        opacity=OPACITY,
        name=name,
        legendgroup=name,
        showlegend=True,
        hoverinfo="name",
        lighting={"ambient": 1.0, "diffuse": 0.0},
    )
    edge = go.Scatter3d(
        **_coordinates(np.concatenate([outline, outline[:1]]), origin),
        mode="lines",
        line={"color": PREDICTED, "width": 3},
        legendgroup=name,
        showlegend=False,
        hoverinfo="skip",
    )
    return [face, edge]


def _coordinates(points: np.ndarray, origin: np.ndarray) -> dict[str, np.ndarray]:
    """x, y and z about an origin, in single precision: half the page, and what WebGL draws in anyway."""
    return dict(zip("xyz", (points - origin).astype(np.float32).T, strict=True))
