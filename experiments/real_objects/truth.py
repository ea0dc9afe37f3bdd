"""True planes of a mesh, found without any detector: many directions, a robust fit, and a share of the exact surface.

1,000 directions and the principal axes, each through the centroid and at offsets, are scored by mirrored samples; the
best of each neighbourhood are fitted to the surface by robust least squares. What counts is then the share of the
surface whose mirror image lies within TOLERANCE of a triangle. Lengths are shares of the box's diagonal.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from experiments.real_objects.meshes import MeshSurface
from symshrec.geometry.hemisphere import hemisphere_directions
from symshrec.planes import Planes, axis_angles

TOLERANCE = 0.002
EXACT, NEARLY = 0.95, 0.80
DIRECTIONS, STARTS = 1000, 60
OFFSETS = (0.0, -0.02, 0.02, -0.05, 0.05)
FAR = 0.05  # a mirrored sample farther from the surface counts as that far in the search
REACHES, ROUNDS = (0.02, 0.005, 0.001), 6  # of the fit: the scale of its loss, again and again
WORTH = 0.6  # of the samples mirrored to within 5 tolerances after a fit, or a start is given up
APART_DEG, APART = 1.0, 0.005  # nearer planes are one
DENSE, SPARSE, NEAREST = 200_000, 4000, 8
SEARCHED, FITTED, JUDGED = 150, (300, 1000, 1000), 5000  # mirrored samples


@dataclass(frozen=True, eq=False)
class Sampled:
    """A surface of diagonal 1 with a dense sample of it: points (N, 3), normals (N, 3), triangles (N,), a tree."""

    surface: MeshSurface
    points: np.ndarray
    normals: np.ndarray
    rows: np.ndarray
    tree: cKDTree

    @classmethod
    def of(cls, surface: MeshSurface) -> "Sampled":
        """The same for the same surface."""
        chart = surface.draw(DENSE, np.random.default_rng(0))
        points = surface.points(chart)
        return cls(surface, points, surface.normals(chart), chart[:, 2].astype(int), cKDTree(points))

    def share(self, plane: Planes) -> float:
        """Of the surface, by area: whose mirror image in a plane lies within TOLERANCE of it."""
        images = plane.mirror(self.points[-JUDGED:])[0]
        rows = self.rows[self.tree.query(images, NEAREST)[1]]
        gaps = [to_triangles(images, self.surface.triangles[rows[:, k]]) for k in range(NEAREST)]
        return float((np.min(gaps, axis=0) <= TOLERANCE).mean())


def true_planes(triangles: np.ndarray) -> tuple[Planes, Planes]:
    """The exact planes of triangles (F, 3, 3), and those that are nearly so; confidence is the share of the surface."""
    low, high = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
    diagonal = float(np.linalg.norm(high - low))
    sampled = Sampled.of(MeshSurface((triangles - low) / diagonal))
    fits = starts(sampled)
    for reach, count in zip(REACHES, FITTED, strict=True):
        fitted = (fit(sampled, plane, reach, count) for plane in fits)
        fits = distinct([plane for plane in fitted if plane is not None], sampled.points.mean(axis=0))
    if not fits:
        return Planes.empty(), Planes.empty()
    shares = [sampled.share(plane) for plane in fits]
    found = Planes(*(np.concatenate([getattr(plane, key) for plane in fits]) for key in ("normals", "points")), shares)
    found = found.ranked().transformed(scale=diagonal, translation=low)
    return found[found.confidences >= EXACT], found[(found.confidences >= NEARLY) & (found.confidences < EXACT)]


def starts(sampled: Sampled) -> list[Planes]:
    """Planes that mirror a few samples best: the best of every neighbourhood of directions, and the principal axes'."""
    centroid = sampled.points.mean(axis=0)
    axes = np.linalg.eigh(np.cov(sampled.points.T))[1].T
    normals = np.concatenate([axes, hemisphere_directions(DIRECTIONS)])
    probes, tree = sampled.points[-SEARCHED:], cKDTree(sampled.points[:SPARSE])
    scores, offsets = np.full(len(normals), np.inf), np.zeros(len(normals))
    for offset in OFFSETS:
        at = normals @ centroid + offset
        images = Planes(normals, at[:, None] * normals).mirror(probes)
        gaps = np.minimum(tree.query(images, distance_upper_bound=FAR)[0], FAR).mean(axis=1)
        better = gaps < scores
        scores[better], offsets[better] = gaps[better], at[better]
    close = axis_angles(normals, normals) < np.radians(5)
    order = np.argsort(scores, kind="stable")
    peaks = [row for row in order if scores[row] <= scores[close[row]].min()][:STARTS]
    rows = np.array(list(dict.fromkeys([0, 1, 2, *peaks])))
    planes = Planes(normals[rows], offsets[rows, None] * normals[rows])
    return [planes[row] for row in range(len(planes))]


def fit(sampled: Sampled, plane: Planes, reach: float, count: int) -> Planes | None:
    """The plane nearby that mirrors samples onto the surface; None where hardly any come near it.

    Gauss–Newton with Cauchy's weights at scale `reach` on the heights of mirrored samples over the tangent plane of the
    nearest sample, in two turns about the centroid and a shift.
    """
    probes, centre = sampled.points[-count:], sampled.points.mean(axis=0)
    normal, offset = plane.normals[0], plane.offsets[0]
    for _ in range(ROUNDS):
        heights = probes @ normal - offset
        images = probes - 2 * heights[:, None] * normal
        gaps, nearest = sampled.tree.query(images, distance_upper_bound=max(4 * reach, 5 * TOLERANCE))
        near = np.isfinite(gaps)
        nearest = np.where(near, nearest, 0)
        tangent = sampled.normals[nearest]
        above = np.einsum("nd,nd->n", images - sampled.points[nearest], tangent)
        if near.mean() < WORTH / 3:
            return None
        weights = near / (1 + (above / reach) ** 2)
        across = np.linalg.svd(normal[None])[2][1:]
        aside = (probes - centre) @ across.T
        slopes = np.empty((len(probes), 3))
        slopes[:, :2] = -2 * (aside * (tangent @ normal)[:, None] + heights[:, None] * (tangent @ across.T))
        slopes[:, 2] = 2 * tangent @ normal
        weighted = slopes * weights[:, None]
        change = -np.linalg.lstsq(weighted.T @ slopes, weighted.T @ above, rcond=1e-9)[0]
        turned = normal + change[:2] @ across
        turned /= np.linalg.norm(turned)
        normal, offset = turned, float(offset + (turned - normal) @ centre + change[2])
    if (near & (np.abs(above) < 5 * TOLERANCE)).mean() < WORTH:
        return None
    return Planes(normal[None], offset * normal[None])


def distinct(fitted: list[Planes], centre: np.ndarray) -> list[Planes]:
    """Of planes that are nearly the same the first alone."""
    kept: list[Planes] = []
    for plane in fitted:
        height = float(centre @ plane.normals[0] - plane.offsets[0])
        for other in kept:
            sign = np.sign(plane.normals[0] @ other.normals[0])
            apart = abs(height - sign * float(centre @ other.normals[0] - other.offsets[0]))
            if apart < APART and np.rad2deg(axis_angles(plane.normals, other.normals)[0, 0]) < APART_DEG:
                break
        else:
            kept.append(plane)
    return kept


def to_triangles(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Distance (N,) from points (N, 3) to triangles (N, 3, 3), one each."""
    a, edges = triangles[:, 0], triangles[:, 1:] - triangles[:, :1]
    normals = np.cross(edges[:, 0], edges[:, 1])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    corners = np.roll(triangles, -1, axis=1)
    inside, nearest = np.ones(len(points), dtype=bool), np.full(len(points), np.inf)
    for k in range(3):
        edge, way = corners[:, k] - triangles[:, k], points - triangles[:, k]
        inside &= np.einsum("nd,nd->n", np.cross(edge, way), normals) >= 0
        along = np.einsum("nd,nd->n", edge, way) / np.maximum(np.einsum("nd,nd->n", edge, edge), 1e-300)
        nearest = np.minimum(nearest, np.linalg.norm(way - np.clip(along, 0, 1)[:, None] * edge, axis=1))
    return np.where(inside, np.abs(np.einsum("nd,nd->n", points - a, normals)), nearest)
