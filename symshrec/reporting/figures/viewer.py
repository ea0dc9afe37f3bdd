"""A cloud with its true and predicted planes in a window of Polyscope, the extra `view`."""

import os
import sys
from dataclasses import dataclass
from importlib.util import find_spec

import numpy as np
from matplotlib.colors import to_rgb

from symshrec.planes import Planes
from symshrec.reporting.figures.drawing import POINTS, PREDICTED, TRUE
from symshrec.reporting.figures.outlines import outline, round_length
from symshrec.scans.palette import colour_code, colour_number
from symshrec.scans.polygons import Mesh
from symshrec.scans.report import diagonal_of

OPACITY = 0.35
SURFACE = (0.62, 0.65, 0.7)
AXES = ("#c23b22", "#2e8b57", "#2c5aa0")  # x, y and z, red, green and blue as everywhere
RADIUS = 0.0018  # of a point, as a share of the cloud's diagonal


def require_window() -> None:
    """Fail before any work is done.

    Raises:
        ValueError: where Polyscope is not installed, or there is no screen to open a window on.
    """
    if not find_spec("polyscope"):
        raise ValueError("view needs Polyscope: pip install 'symshrec[view]'; symshrec detect --plot does without")
    if sys.platform == "linux" and not any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY")):
        raise ValueError("there is no screen here to open a window on; symshrec detect --plot draws to a file")


@dataclass(frozen=True, eq=False)
class Scene:
    """What is looked at, near the origin, since the window draws in single precision.

    Attributes:
        points: (N, 3). mesh: that they are of; its faces are drawn, and the points hidden.
        planes, predicted: true and predicted ones, None where they are not known.
        deviations: (K, N), of the points from their mirror images in the predicted planes, to be chosen in the window.
    """

    name: str
    points: np.ndarray
    planes: Planes | None = None
    predicted: Planes | None = None
    mesh: Mesh | None = None
    deviations: np.ndarray | None = None


def register(scene: Scene) -> None:
    """Hand a shape and its planes to an initialised Polyscope.

    True planes are blue and predicted ones vermilion where both are there; predicted ones alone have the colours of
    their numbers, as `symshrec detect` gives them. Each set is a group that can be hidden as one; planes are cut
    to the shape's extent.
    """
    import polyscope

    points, mesh, predicted = np.asarray(scene.points, dtype=np.float64), scene.mesh, scene.predicted
    extent = diagonal_of(points)
    polyscope.set_up_dir("z_up")
    polyscope.set_ground_plane_mode("none")
    polyscope.set_transparency_mode("pretty")
    cloud = polyscope.register_point_cloud(scene.name, points, color=to_rgb(POINTS), enabled=mesh is None)
    cloud.set_radius(RADIUS * extent, relative=False)
    for row, values in enumerate([] if scene.deviations is None else scene.deviations):
        most = float(np.quantile(np.abs(values), 0.99)) or 1e-12
        title = f"distance from the mirror image in plane {row + 1}"
        cloud.add_scalar_quantity(title, values, vminmax=(-most, most), cmap="coolwarm")
    if mesh is not None:
        surface = polyscope.register_surface_mesh(f"{scene.name} faces", mesh.vertices, mesh.triangles, color=SURFACE)
        surface.set_smooth_shade(False)
    _register_scale(polyscope, points)
    for title, layer, colour in (("true planes", scene.planes, TRUE), ("predicted planes", predicted, PREDICTED)):
        if layer is None or not len(layer):
            continue
        group = polyscope.create_group(title)
        group_of = layer.group(extent) if layer is predicted and scene.planes is None and extent else None
        for number, (normal, point, confidence) in enumerate(
            zip(layer.normals, layer.points, layer.confidences, strict=True), 1
        ):
            named = f"{title.removesuffix('s')} {number}"
            named += f", confidence {confidence:.2f}" * (layer is predicted)
            own = colour_code(colour_number(layer, group_of, number - 1)) if group_of else colour
            corners, faces = outline(points, normal, point), np.array([[0, 1, 2], [0, 2, 3]])
            drawn = polyscope.register_surface_mesh(
                named, corners, faces, color=to_rgb(own), transparency=OPACITY, edge_width=0.0
            )
            drawn.set_back_face_policy("identical")
            drawn.add_to_group(group)


def _register_scale(polyscope, points: np.ndarray) -> None:
    """The three axes' directions, each of a round length that its name tells, beside the shape."""
    low, sides = points.min(axis=0), np.ptp(points, axis=0)
    length = round_length(0.25 * sides.max() or 1.0)
    start = low - 0.08 * sides.max()
    for axis, (name, colour) in enumerate(zip("xyz", AXES, strict=True)):
        ends = np.stack([start, start + length * np.eye(3)[axis]])
        line = polyscope.register_curve_network(f"{name} axis, {length:g} long", ends, "line", color=to_rgb(colour))
        line.set_radius(2 * RADIUS * float(np.linalg.norm(sides)), relative=False)


def show(scene: Scene) -> None:
    """Open the window, and wait until it is closed.

    Raises:
        ValueError: as `require_window`, and where the screen has no OpenGL.
    """
    require_window()
    import polyscope

    polyscope.set_program_name("symshrec view")
    polyscope.set_use_prefs_file(False)  # which would be left in the working folder
    try:
        polyscope.init()
    except RuntimeError as error:
        raise ValueError(f"no window can be opened ({error}); the viewer needs a screen with OpenGL") from error
    register(scene)
    polyscope.show()
