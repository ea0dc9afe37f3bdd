"""§3.3 M3 line by line as the paper words it, without the shortcuts of `methods.m3`: for tests and benchmarks."""

import numpy as np
import robust_laplacian
from scipy.sparse.linalg import eigsh
from scipy.spatial import cKDTree

from symshrec.planes import Planes


def detect_planes(
    points: np.ndarray,
    neighbours=200,
    eigenpairs=10,
    mollify=1e-3,
    time_factor=0.3,
    chamfer_limit=100.0,
    separation_deg=5.0,
) -> Planes:
    """The mirror planes of a well-formed cloud: (N, 3), distinct points, N above `neighbours` and 30.

    The Laplacian depends on the order of the points, so a comparison must pass them through
    `symshrec.methods.m3.pipeline.spatial_order` first.

    The arguments are those of `symshrec.methods.m3.settings.M3Settings`.
    """
    # "rescales the point cloud such that the diagonal of the object measures one"
    points = np.asarray(points, dtype=np.float64)
    centre = (points.min(0) + points.max(0)) / 2
    diagonal = np.linalg.norm(points.max(0) - points.min(0))
    cloud = (points - centre) / diagonal

    # "calculates the Laplacian ... the eigen-decomposition of the Laplacian to obtain ten eigenvalues"
    laplacian, mass = robust_laplacian.point_cloud_laplacian(cloud, mollify_factor=mollify)
    start = np.random.default_rng(1).standard_normal(len(cloud))
    eigenvalues, eigenvectors = eigsh(laplacian, eigenpairs, mass, sigma=1e-8, v0=start)
    time = time_factor / eigenvalues[1]
    values = time * eigenvectors[:, 0] ** 2
    for eigenvalue, eigenvector in zip(eigenvalues[1:], eigenvectors.T[1:], strict=True):
        values = values + (1 - np.exp(-eigenvalue * time)) / eigenvalue * eigenvector**2

    # "a local maximum ... if S(v, t) is greater than S(w, t) for every point w in the K-nearest neighbourhood"
    tree = cKDTree(cloud)
    _, nearest = tree.query(cloud, neighbours + 1)
    maxima = [v for v in range(len(cloud)) if all(values[v] > values[w] for w in nearest[v] if w != v)]

    # "generates a candidate symmetric plane between every pair" and "computes the bidirectional Chamfer distance"
    candidates = []
    for first, v in enumerate(cloud[maxima]):
        for m in cloud[maxima][first + 1 :]:
            normal = (v - m) / np.linalg.norm(v - m)
            origin = (v + m) / 2
            mirrored = cloud - 2 * ((cloud - origin) @ normal)[:, None] * normal
            there, _ = tree.query(mirrored)
            back, _ = cKDTree(mirrored).query(cloud)
            candidates.append(((there**2).sum() + (back**2).sum(), normal, origin))

    # "sorting them according to their bidirectional Chamfer distance and performing a greedy selection"
    kept = []
    for chamfer, normal, origin in sorted(candidates, key=lambda candidate: candidate[0]):
        angles = [np.rad2deg(np.arccos(min(1.0, abs(normal @ other)))) for _, other, _ in kept]
        if chamfer < chamfer_limit and all(angle > separation_deg for angle in angles):
            kept.append((chamfer, normal, origin))

    if not kept:
        return Planes.empty()
    distances, normals, origins = (np.array(column) for column in zip(*kept, strict=True))
    return Planes(normals, origins * diagonal + centre, 1 - distances / chamfer_limit)
