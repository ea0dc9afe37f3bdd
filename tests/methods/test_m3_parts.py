"""§3.3 M3's steps by themselves: maxima, spectrum, diffusion and selection, beside what defines them."""

import numpy as np
import robust_laplacian
from scipy.spatial import cKDTree

from symshrec.methods.m3 import selection, spectrum
from symshrec.methods.m3.candidates import local_maxima
from symshrec.methods.m3.pipeline import spatial_order
from symshrec.planes import Planes, axis_angles


def petal_cone(count):
    """A cone over ρ = 2 + cos 4u."""
    rng = np.random.default_rng(0)
    u, s = rng.uniform(-np.pi, np.pi, count), np.sqrt(rng.uniform(0, 1, count))
    radius = (2 + np.cos(4 * u)) / 3
    return np.stack([s * radius * np.cos(u), s * radius * np.sin(u), 1.3 * s], axis=1)


def test_local_maxima_against_every_distance():
    rng = np.random.default_rng(4)
    points, values = rng.random((300, 2)), rng.random(300)
    values[10] = values[11] = 2.0
    points[11] = points[10] + 1e-3
    for neighbours in (3, 20, 299, 500):
        distances = np.linalg.norm(points[:, None] - points, axis=-1)
        nearest = np.argsort(distances, axis=1)[:, 1 : neighbours + 1]
        expected = [i for i in range(300) if all(values[i] > values[j] for j in nearest[i])]
        np.testing.assert_array_equal(local_maxima(cKDTree(points), values, neighbours), expected)


def test_diffusion_limits():
    eigenvalues, eigenvectors = np.array([0.0, 2.0, 5.0]), np.random.default_rng(0).random((7, 3))
    squares = eigenvectors**2
    np.testing.assert_allclose(
        spectrum.diffusion(eigenvalues, eigenvectors, 1e-9) / 1e-9, squares.sum(1) / 2, rtol=1e-6
    )
    weights = [0.5, (1 - np.exp(-1.0)) / 2, (1 - np.exp(-2.5)) / 5]
    np.testing.assert_allclose(spectrum.diffusion(eigenvalues, eigenvectors, 1.0), squares @ weights)
    np.testing.assert_allclose(spectrum.diffusion(eigenvalues, eigenvectors, np.inf), squares @ [0, 1 / 2, 1 / 5])


def test_spectrum_solves_the_eigenproblem():
    points = spatial_order(petal_cone(500))
    laplacian, mass = robust_laplacian.point_cloud_laplacian(points, mollify_factor=1e-3)
    eigenvalues, eigenvectors = spectrum.laplacian_spectrum(points, 10, 1e-3, 30)
    np.testing.assert_allclose(laplacian @ eigenvectors, (mass @ eigenvectors) * eigenvalues, atol=1e-8)
    np.testing.assert_allclose(eigenvectors.T @ (mass @ eigenvectors), np.eye(10), atol=1e-8)
    smallest = np.sort(np.linalg.eigvals(laplacian.toarray() / mass.diagonal()[:, None]).real)[:10]
    np.testing.assert_allclose(eigenvalues, smallest, atol=1e-6)


def test_selection_keeps_what_sorting_keeps_at_less_cost(monkeypatch):
    rng = np.random.default_rng(6)
    cloud = spatial_order(petal_cone(1000))
    normals = np.repeat(np.eye(3)[:2], 20, axis=0) + 0.03 * rng.normal(size=(40, 3))
    normals = np.concatenate([normals, rng.normal(size=(5, 3))])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    origins = normals * rng.uniform(0, 0.5, (45, 1))
    asked, original = [], selection._squared_distances

    def counted(tree, share, *plane):
        asked.append(len(share))
        return original(tree, share, *plane)

    monkeypatch.setattr(selection, "_squared_distances", counted)
    kept, distances = selection.select_planes(cKDTree(cloud), normals, origins, 500.0, 5.0)

    mirrored = Planes(normals, origins).mirror(cloud)
    exact = np.array([2 * (cKDTree(cloud).query(image)[0] ** 2).sum() for image in mirrored])
    expected = []
    for candidate in np.argsort(exact):
        if exact[candidate] < 500 and (axis_angles(normals[[candidate]], normals[expected]) > np.deg2rad(5)).all():
            expected.append(candidate)
    np.testing.assert_array_equal(kept, expected)
    np.testing.assert_allclose(distances, exact[expected])
    assert sum(asked) < 0.6 * len(normals) * len(cloud)
