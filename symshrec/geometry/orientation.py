"""Which side of a cloud's surface is outside: normals made to agree, after Hoppe et al. 1992."""

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import breadth_first_order, connected_components, minimum_spanning_tree
from scipy.spatial import cKDTree

NEIGHBOURS = 10  # that a normal is compared with
LEAST = 1e-3  # cost of a step between parallel normals; nought would be no step


def oriented(tree: cKDTree, normals: np.ndarray) -> np.ndarray:
    """Normals (N, 3) of the points of a tree, each turned to the side that its neighbours' are on.

    Signs spread over the cheapest tree of steps between neighbours, a step costing what their normals differ by. Every
    connected part starts at the point farthest from its middle, whose normal points away from there.

    >>> points = np.random.default_rng(0).normal(size=(500, 3))
    >>> points /= np.linalg.norm(points, axis=1, keepdims=True)
    >>> flipped = points * np.where(np.arange(500) % 2, 1, -1)[:, None]
    >>> bool(np.allclose(oriented(cKDTree(points), flipped), points))
    True
    """
    count = len(normals)
    if count < 2:
        return normals
    near = tree.query(tree.data, k=np.arange(2, min(NEIGHBOURS + 1, count) + 1))[1]
    rows, columns = np.repeat(np.arange(count), near.shape[1]), near.ravel()
    costs = LEAST + 1 - np.abs(np.einsum("nd,nd->n", normals[rows], normals[columns]))
    steps = minimum_spanning_tree(coo_matrix((costs, (rows, columns)), (count, count)).tocsr())
    parts, labels = connected_components(steps, directed=False)
    middles = np.stack([np.bincount(labels, tree.data[:, axis], parts) for axis in range(3)], 1)
    ways = tree.data - (middles / np.bincount(labels)[:, None])[labels]
    signs, order = np.zeros(count), np.lexsort([-np.linalg.norm(ways, axis=1), labels])
    for seed in order[np.r_[True, np.diff(labels[order]) > 0]]:
        signs[seed] = 1 if normals[seed] @ ways[seed] >= 0 else -1
        reached, before = breadth_first_order(steps, seed, directed=False)
        agree = np.where(np.einsum("nd,nd->n", normals[reached[1:]], normals[before[reached[1:]]]) < 0, -1, 1)
        for place, same in zip(reached[1:].tolist(), agree.tolist(), strict=True):
            signs[place] = same * signs[before[place]]
    return normals * signs[:, None]
