"""The missing side of a shape: which of its mirror image lies where nothing was observed."""

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

AROUND = 6  # points next to one, the last of which tells the spacing there
CLEAR = 2.0  # times that spacing, from which nothing was observed at a place
TOUCHING = 5.0  # times, up to which a place is next to what was observed
EDGE_NEIGHBOURS, EDGE = 24, 0.25  # the middle of an edge's neighbours is so far from it, as a share of their reach
BEYOND = 0.25  # least cosine between the way to a place and the way out across the edge
SMALLEST = 6  # places that make a part; fewer lie in a gap between points


def unobserved(points: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Which places of a mirror image continue the shape where it was not observed: (M,) bool.

    Places far from all points make connected parts. A part that continues the shape beyond an edge of it, such as a cut
    or the end of what a scanner saw, was not observed. A part that hovers before or behind surface that was observed,
    such as the image of a cup's one handle, is the shape's own asymmetry, and no place of it is given.

    Args:
        points: (N, 3), observed, about evenly dense. places: (M, 3), of its mirror image.

    Raises:
        ValueError: for fewer than 7 points, which tell no spacing.

    >>> x, y = (grid.ravel() for grid in np.meshgrid(np.arange(-5.0, 20), np.arange(12.0)))
    >>> sheet = np.stack([x, y, 0 * x], 1)
    >>> filled = unobserved(sheet, sheet * [-1, 1, 1])
    >>> sorted(set(x[filled].tolist())) == list(range(7, 20))
    True
    """
    if len(points) <= AROUND:
        raise ValueError(f"there are {len(points)} points; it takes {AROUND + 1} to tell where nothing was observed")
    tree = cKDTree(points)
    distances, nearest = tree.query(places)
    spacing = _spacing(tree)
    far = distances > CLEAR * spacing[nearest]
    fill = np.zeros(len(places), dtype=bool)
    if not far.any():
        return fill
    rows = np.flatnonzero(far)
    parts = _parts(places[rows], CLEAR * np.median(spacing))
    touching = distances[rows] < TOUCHING * spacing[nearest[rows]]
    beyond = np.zeros(len(rows), dtype=bool)
    beyond[touching] = _beyond_an_edge(tree, nearest[rows[touching]], places[rows[touching]])
    sizes, touched, crossed = (np.bincount(parts, each) for each in (np.ones(len(rows)), touching, beyond))
    fill[rows] = ((sizes >= SMALLEST) & (crossed >= touched / 2))[parts]
    if fill.any():  # up to the edge
        seam = np.flatnonzero(~far & (distances > spacing[nearest]))
        close = cKDTree(places[fill]).query(places[seam])[0] < CLEAR * spacing[nearest[seam]]
        fill[seam] = close & _beyond_an_edge(tree, nearest[seam], places[seam])
    return fill


def _spacing(tree: cKDTree) -> np.ndarray:
    """How far apart the points around each one are, (N,): of those inside, where it is at an edge."""
    count = min(EDGE_NEIGHBOURS, tree.n)
    distances, others = tree.query(tree.data, k=count)
    return np.median(distances[:, AROUND][others], axis=1)


def _parts(places: np.ndarray, reach: float) -> np.ndarray:
    """The number of each place's connected part: (M,); steps are no longer than `reach`."""
    tree = cKDTree(places)
    near = min(AROUND + 2, len(places))
    lengths, others = tree.query(places, k=np.arange(1, near + 1), distance_upper_bound=reach)
    first = np.repeat(np.arange(len(places)), near)[np.isfinite(lengths.ravel())]
    second = others.ravel()[np.isfinite(lengths.ravel())]
    graph = coo_matrix((np.ones(len(first)), (first, second)), (len(places), len(places)))
    return connected_components(graph, directed=False)[1]


def _beyond_an_edge(tree: cKDTree, nearest: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Whether places lie across an edge of the surface from their nearest points, (M,)."""
    if not len(places):
        return np.zeros(0, dtype=bool)
    points = tree.data[nearest]
    distances, others = tree.query(points, k=min(EDGE_NEIGHBOURS, tree.n))
    inwards = tree.data[others].mean(axis=1) - points
    length, way = np.linalg.norm(inwards, axis=1), places - points
    cosines = -(inwards * way).sum(axis=1) / np.maximum(length * np.linalg.norm(way, axis=1), np.finfo(float).tiny)
    return (length > EDGE * distances[:, -1]) & (cosines > BEYOND)
