"""The surface of a mesh: where on it points are nearest to."""

from copy import copy

import numpy as np
from scipy.spatial import cKDTree

SAMPLES = 100_000  # points on the surface, beside every triangle's corners and middle, that lead to triangles
CANDIDATES = 8  # of those, nearest to a point, whose triangles are measured
BLOCK = 50_000  # points measured at once


class MeshSurface:
    """A mesh's triangles, to be asked for the nearest place.

    Args:
        vertices: (V, 3), finite. triangles: (F ≥ 1, 3), places among them.

    >>> square = MeshSurface(np.array([[0.0, 0, 0], [9, 0, 0], [9, 9, 0], [0, 9, 0]]), np.array([[0, 1, 2], [0, 2, 3]]))
    >>> feet, distances, _ = square.closest(np.array([[4.5, 3, -2], [10, 4, 0]]))
    >>> feet.round(9).tolist(), distances.round(9).tolist()
    ([[4.5, 3.0, 0.0], [9.0, 4.0, 0.0]], [2.0, 1.0])
    """

    def __init__(self, vertices: np.ndarray, triangles: np.ndarray):
        self.corners = vertices[triangles]  # (F, 3, 3)
        edges = self.corners[:, 1:] - self.corners[:, :1]
        areas = np.cumsum(np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1))
        rng, faces = np.random.default_rng(0), np.arange(len(triangles))
        drawn = np.searchsorted(areas, rng.random(SAMPLES) * areas[-1]).clip(max=len(faces) - 1)
        weights = rng.dirichlet(np.ones(3), SAMPLES)
        places = np.einsum("nc,ncd->nd", weights, self.corners[drawn])
        self.tree = cKDTree(np.concatenate([places, self.corners.mean(axis=1), self.corners.reshape(-1, 3)]))
        self.faces = np.concatenate([drawn, faces, np.repeat(faces, 3)])

    def moved(self, shift: np.ndarray) -> "MeshSurface":
        """The same mesh, moved by `shift` (3,)."""
        other = copy(self)
        other.corners, other.tree = self.corners + shift, cKDTree(self.tree.data + shift)
        return other

    def closest(self, queries: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Where on the surface (N, 3) points are nearest to: feet (N, 3), distances (N,) and triangles (N,)."""
        feet, faces = np.empty((len(queries), 3)), np.empty(len(queries), dtype=np.int64)
        for start in range(0, len(queries), BLOCK):
            block = queries[start : start + BLOCK]
            candidates = self.faces[self.tree.query(block, k=CANDIDATES)[1]]  # (n, k)
            places = on_triangles(np.repeat(block, CANDIDATES, axis=0), self.corners[candidates.ravel()])
            places = places.reshape(len(block), CANDIDATES, 3)
            best = np.linalg.norm(places - block[:, None], axis=2).argmin(axis=1)
            rows = np.arange(len(block))
            feet[start : start + BLOCK], faces[start : start + BLOCK] = places[rows, best], candidates[rows, best]
        return feet, np.linalg.norm(queries - feet, axis=1), faces


def on_triangles(queries: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """The point of each of (N, 3, 3) triangles nearest to each of (N, 3) points: (N, 3).

    >>> on_triangles(np.array([[2.0, 2, 5]]), np.array([[[0.0, 0, 0], [2, 0, 0], [0, 2, 0]]])).tolist()
    [[1.0, 1.0, 0.0]]
    """
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normals = np.cross(first, second)
    squares = np.maximum((normals**2).sum(axis=1), np.finfo(float).tiny)
    offsets = queries - corners[:, 0]
    b = (np.cross(offsets, second) * normals).sum(axis=1) / squares
    c = (np.cross(first, offsets) * normals).sum(axis=1) / squares
    inside = (b >= 0) & (c >= 0) & (b + c <= 1) & (squares > np.finfo(float).tiny)
    choices = [corners[:, 0] + b[:, None] * first + c[:, None] * second]
    for here, after in ((0, 1), (1, 2), (2, 0)):
        along = corners[:, after] - corners[:, here]
        share = ((queries - corners[:, here]) * along).sum(axis=1)
        share = np.clip(share / np.maximum((along**2).sum(axis=1), np.finfo(float).tiny), 0, 1)
        choices.append(corners[:, here] + share[:, None] * along)
    distances = np.stack([np.linalg.norm(queries - each, axis=1) for each in choices], axis=1)
    distances[:, 0] = np.where(inside, distances[:, 0], np.inf)
    return np.stack(choices, axis=1)[np.arange(len(queries)), distances.argmin(axis=1)]
