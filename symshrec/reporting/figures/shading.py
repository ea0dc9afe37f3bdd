"""A shape's points or faces in grey, or in the colours of its deviation, as seen from somewhere."""

import numpy as np
from matplotlib import colormaps
from scipy.spatial import cKDTree

from symshrec.reporting.figures.faces import rasterised
from symshrec.reporting.figures.raster import Canvas, splat
from symshrec.reporting.figures.subject import Subject

GREY = np.array([0.62, 0.65, 0.7])
DIVERGING = "RdBu_r"
LIGHT = np.array([0.25, 0.55, 0.8]) / np.linalg.norm([0.25, 0.55, 0.8])  # towards it: right, up and to the viewer
AMBIENT, DIFFUSE = 0.55, 0.5
NEIGHBOURS = 4  # points that a deviation between them is the mean of
THINNED = 2000  # points that a spacing is taken from
SMALLEST, LARGEST = 1, 9  # pixels, of a point's radius


def shaded(subject: Subject, canvas: Canvas, size: float) -> tuple[np.ndarray, np.ndarray]:
    """Depths (size, size), -∞ where nothing is, and colours (size, size, 3), on white.

    Args:
        size: of a point's radius, as a share of what lies between neighbours.
    """
    if subject.mesh is None:
        colours = _colours(subject, subject.points)
        radius = size * _spacing(subject.points) / (2 * canvas.half) * canvas.size
        return splat(canvas, subject.points, colours, float(np.clip(radius, SMALLEST, LARGEST)))
    corners = subject.mesh.vertices[subject.mesh.triangles]
    depth, faces = rasterised(canvas, corners)
    image, there = np.ones((*depth.shape, 3)), faces >= 0
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(float).tiny)
    normals = normals @ canvas.view.axes.T
    normals *= np.where(normals[:, 2:] < 0, -1, 1)  # either side is lit alike
    light = AMBIENT + DIFFUSE * np.maximum(0, normals @ LIGHT)
    image[there] = _colours(subject, canvas.places(depth)[there]) * light[faces[there]][:, None]
    return depth, image.clip(0, 1)


def _colours(subject: Subject, places: np.ndarray) -> np.ndarray:
    """(n, 3) of places on the shape."""
    if subject.deviations is None:
        return np.tile(GREY, (len(places), 1))
    values = subject.deviations
    if places is not subject.points:
        count = min(NEIGHBOURS, len(values))
        distances, near = cKDTree(subject.points).query(places, k=np.arange(1, count + 1))
        weights = 1 / np.maximum(distances, np.finfo(float).eps * np.abs(places).max())
        values = (values[near] * weights).sum(axis=1) / weights.sum(axis=1)
    return 0.94 * colormaps[DIVERGING](0.5 + 0.5 * np.clip(values / subject.limit, -1, 1))[:, :3]


def _spacing(points: np.ndarray) -> float:
    """How far apart neighbours are."""
    if len(points) < 4:
        return 0.0
    return float(np.median(cKDTree(points).query(points[:: max(1, len(points) // THINNED)], k=4)[0][:, -1]))
