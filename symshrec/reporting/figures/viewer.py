"""A cloud with its true and predicted planes in a window of Polyscope, the extra `view`."""

import os
import sys
from importlib.util import find_spec

import numpy as np
from matplotlib.colors import to_rgb

from symshrec.planes import Planes
from symshrec.reporting.figures.drawing import POINTS, PREDICTED, TRUE, box, clip_plane

OPACITY = 0.35
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


def register(points: np.ndarray, planes: Planes | None, predicted: Planes | None, name: str = "cloud") -> None:
    """Hand a cloud (N, 3) and its planes to an initialised Polyscope: true ones blue, predicted ones vermilion.

    Each set is a group that can be hidden as one; planes are cut to the cloud's box.
    """
    import polyscope

    points = np.asarray(points, dtype=np.float64)
    bounds, extent = box(points), float(np.linalg.norm(np.ptp(points, axis=0)))
    polyscope.set_up_dir("z_up")
    polyscope.set_ground_plane_mode("none")
    polyscope.set_transparency_mode("pretty")
    cloud = polyscope.register_point_cloud(name, points, color=to_rgb(POINTS))
    cloud.set_radius(RADIUS * extent, relative=False)
    for title, layer, colour in (("true planes", planes, TRUE), ("predicted planes", predicted, PREDICTED)):
        if layer is None or not len(layer):
            continue
        group = polyscope.create_group(title)
        for number, (normal, point, confidence) in enumerate(
            zip(layer.normals, layer.points, layer.confidences, strict=True), 1
        ):
            outline = clip_plane(normal, point, bounds)
            if not len(outline):
                continue
            named = f"{title.removesuffix('s')} {number}"
            named += f", confidence {confidence:.2f}" * (layer is predicted)
            corners = np.arange(1, len(outline) - 1)
            faces = np.stack([np.zeros_like(corners), corners, corners + 1], axis=1)
            mesh = polyscope.register_surface_mesh(
                named, outline, faces, color=to_rgb(colour), transparency=OPACITY, edge_width=0.0
            )
            mesh.set_back_face_policy("identical")
            mesh.add_to_group(group)


def show(points: np.ndarray, planes: Planes | None, predicted: Planes | None, name: str = "cloud") -> None:
    """Open the window and wait until it is closed.

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
    register(points, planes, predicted, name)
    polyscope.show()
