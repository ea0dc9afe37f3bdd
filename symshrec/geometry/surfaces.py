"""The surface that a cloud's points lie on, as discs through neighbours, and where on it other points belong."""

from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from symshrec.geometry.orientation import oriented

NEIGHBOURS = 12  # points that stand for the surface around one of them


class DiscSurface:
    """The surface near a point is the disc that its nearest distinct neighbours span.

    Args:
        points: (N ≥ 1, 3), finite; a point that is there several times counts once.

    >>> plane = DiscSurface(np.stack(np.meshgrid(np.arange(9.0), np.arange(9.0), [0]), -1).reshape(-1, 3))
    >>> feet, distances, _ = plane.closest(np.array([[4.3, 4.4, 2.0]]))
    >>> feet.round(6).tolist(), distances.round(6).tolist()
    ([[4.3, 4.4, 0.0]], [2.0])
    """

    def __init__(self, points: np.ndarray):
        self.tree = cKDTree(np.unique(points, axis=0))
        self.centres, self.normals, self.radii = _discs(self.tree)

    def closest(self, queries: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Where on the surface (N, 3) points are nearest to: feet (N, 3), distances (N,) and places of discs (N,).

        A foot is on the disc of the nearest point, or is that point where it is nearer.
        """
        distances, nearest = self.tree.query(queries)
        heights, along, beside = self._beside(queries, nearest)
        reach = np.hypot(heights, np.maximum(beside - self.radii[nearest], 0))
        share = np.minimum(1, self.radii[nearest] / np.maximum(beside, np.finfo(float).tiny))
        feet = np.where(
            (reach < distances)[:, None], self.centres[nearest] + share[:, None] * along, self.tree.data[nearest]
        )
        return feet, np.minimum(reach, distances), nearest

    def signed(self, queries: np.ndarray) -> np.ndarray:
        """Distances (N,) of (N, 3) points from the surface, negative inside of it.

        Inside is where the normals, made to agree with their neighbours' from the outermost point on, point away from;
        on a sheet without an inside the sign is one of two, the same all over it.
        """
        _, distances, nearest = self.closest(queries)
        heights = np.einsum("nd,nd->n", queries - self.centres[nearest], self.outward[nearest])
        return np.where(heights < 0, -distances, distances)

    @cached_property
    def outward(self) -> np.ndarray:
        """The discs' normals (N, 3), all on one side of the surface."""
        return oriented(self.tree, self.normals)

    def _beside(self, queries: np.ndarray, nearest: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Of queries over their discs: heights (N,), offsets within the disc's plane (N, 3) and their lengths (N,)."""
        offsets = queries - self.centres[nearest]
        heights = np.einsum("nd,nd->n", offsets, self.normals[nearest])
        along = offsets - heights[:, None] * self.normals[nearest]
        return heights, along, np.linalg.norm(along, axis=1)


def _discs(tree: cKDTree) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Around every point, the disc through its neighbours: centres (N, 3), unit normals (N, 3), radii (N,)."""
    count = min(NEIGHBOURS, tree.n)
    neighbours = tree.data[tree.query(tree.data, k=np.arange(1, count + 1))[1]]  # (N, k, 3)
    centres = neighbours.mean(axis=1)
    offsets = neighbours - centres[:, None]
    normals = np.linalg.eigh(np.einsum("nki,nkj->nij", offsets, offsets))[1][:, :, 0]
    heights = np.einsum("nki,ni->nk", offsets, normals)
    radii = np.sqrt(np.maximum(np.square(offsets).sum(axis=2) - heights**2, 0)).max(axis=1)
    return centres, normals, radii
