"""The surface of a mesh: where on it points are nearest to."""

from copy import copy

import numpy as np
from scipy.spatial import cKDTree

FINENESS = 150  # pieces are no longer than such a part of the mesh's diagonal
CANDIDATES = (12, 48, 192)  # pieces next to a point that are measured, more where a nearer one could be left out
ON_IT = 1e-6  # of the diagonal: what is as near as this is on the surface, and nothing nearer is looked for
BLOCK = 20_000  # points measured at once


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
        diagonal = float(np.linalg.norm(np.ptp(self.corners.reshape(-1, 3), axis=0)))
        self.least = ON_IT * diagonal
        pieces, self.faces = _pieces(self.corners, diagonal / FINENESS)
        middles = pieces.mean(axis=1)
        self.reach = float(np.linalg.norm(pieces - middles[:, None], axis=2).max())
        self.tree = cKDTree(middles)

    def moved(self, shift: np.ndarray) -> "MeshSurface":
        """The same mesh, moved by `shift` (3,)."""
        other = copy(self)
        other.corners, other.tree = self.corners + shift, cKDTree(self.tree.data + shift)
        return other

    def closest(self, queries: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Where on the surface (N, 3) points are nearest to: feet (N, 3), distances (N,) and triangles (N,)."""
        feet, faces = np.empty((len(queries), 3)), np.empty(len(queries), dtype=np.int64)
        for start in range(0, len(queries), BLOCK):
            open_rows = np.arange(start, min(start + BLOCK, len(queries)))
            bounds = np.full(len(open_rows), np.inf)  # no nearest place is farther
            for count in (min(count, self.tree.n) for count in CANDIDATES):
                block = queries[open_rows]
                ways, pieces = self.tree.query(block, k=np.arange(1, count + 1))
                bounds = np.minimum(bounds, ways[:, 0])  # a piece's middle is on the surface
                rows, candidates = self._unlike(ways - self.reach <= bounds[:, None], pieces)
                places = on_triangles(block[rows], self.corners[candidates])
                lengths = np.linalg.norm(places - block[rows], axis=1)
                shortest = np.minimum.reduceat(lengths, np.searchsorted(rows, np.arange(len(block))))
                best = np.flatnonzero(lengths == shortest[rows])
                feet[open_rows[rows[best]]], faces[open_rows[rows[best]]] = places[best], candidates[best]
                left = (shortest > self.least) & (ways[:, -1] - self.reach < shortest)
                open_rows, bounds = open_rows[left], shortest[left]
                if not len(open_rows):
                    break
        return feet, np.linalg.norm(queries - feet, axis=1), faces

    def _unlike(self, chosen: np.ndarray, pieces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rows (n,), ascending, and the triangles (n,) whose chosen pieces (N, count) are theirs, each but once."""
        rows = np.nonzero(chosen)[0]
        return np.divmod(np.unique(rows * len(self.corners) + self.faces[pieces[chosen]]), len(self.corners))


def _pieces(corners: np.ndarray, longest: float) -> tuple[np.ndarray, np.ndarray]:
    """Triangles (F, 3, 3) halved across their longest edge until none is longer: (P, 3, 3), and whose they are (P,)."""
    faces, done = np.arange(len(corners)), []
    while len(corners):
        lengths = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)  # of the edge after each corner
        long = lengths.max(axis=1) > longest
        done.append((corners[~long], faces[~long]))
        corners, faces = corners[long], faces[long]
        turn = (lengths[long].argmax(axis=1)[:, None] + np.arange(3)) % 3
        a, b, c = np.take_along_axis(corners, turn[:, :, None], axis=1).swapaxes(0, 1)
        middle = (a + b) / 2
        corners, faces = np.concatenate([np.stack([a, middle, c], 1), np.stack([middle, b, c], 1)]), np.tile(faces, 2)
    return np.concatenate([each for each, _ in done]), np.concatenate([each for _, each in done])


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
