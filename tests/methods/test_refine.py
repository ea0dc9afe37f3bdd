"""Refinement brings planes that are a little off to the true ones, and leaves alone what it cannot better."""

import numpy as np
import pytest
import torch

from symshrec.methods.refine import refine_planes
from symshrec.methods.refine.alignment import Pairs, mirrored, tangents
from symshrec.methods.refine.coupling import closure, find_relations, images_of_planes
from symshrec.methods.refine.ends import end_offset
from symshrec.methods.refine.surface import local_surface, smallest_eigenvectors
from symshrec.planes import Planes, axis_angles


def wavy_cone(count=2500, seed=0, noise=0.0):
    rng = np.random.default_rng(seed)
    u, s = rng.uniform(-np.pi, np.pi, count), np.sqrt(rng.uniform(0, 1, count))
    radius = (2 + np.cos(3 * u)) / 3
    points = np.stack([s * radius * np.cos(u), s * radius * np.sin(u), 1.3 * s], axis=1)
    points[::2] += noise * rng.normal(size=points[::2].shape)
    return points + np.array([5, 0, 0])


def truth():
    angles = np.arange(3) * np.pi / 3
    normals = np.stack([-np.sin(angles), np.cos(angles), 0 * angles], axis=1)
    return Planes(normals, np.tile([5.0, 0.0, 0.0], (3, 1)), np.array([0.3, 0.9, 0.6]))


def off(planes, angle_deg, distance, seed=0):
    rng = np.random.default_rng(seed)
    sideways = np.cross(planes.normals, rng.normal(size=(len(planes), 3)))
    sideways /= np.linalg.norm(sideways, axis=1, keepdims=True)
    normals = planes.normals + np.tan(np.deg2rad(angle_deg)) * sideways
    return Planes(normals, planes.points + distance * planes.normals, planes.confidences)


def errors(planes):
    angles = np.rad2deg(np.diagonal(axis_angles(planes.normals, truth().normals)))
    return angles.max(), np.abs(np.einsum("kd,kd->k", planes.points - truth().points, truth().normals)).max()


@pytest.mark.parametrize(("angle_deg", "distance", "noise"), [(5, 0.1, 0.0), (2, 0.05, 0.03), (0.5, 0.0, 0.03)])
def test_converges_to_the_true_planes(angle_deg, distance, noise):
    points = wavy_cone(noise=noise)
    refined = refine_planes(points, off(truth(), angle_deg, distance))
    angle, gap = errors(refined.planes)
    assert angle < 0.2
    assert gap < 0.01
    assert not refined.kept.any()
    np.testing.assert_array_equal(refined.planes.confidences, truth().confidences)


def test_residuals_are_in_the_units_of_the_cloud():
    clean, noisy = (refine_planes(wavy_cone(noise=noise), truth()).residuals for noise in (0.0, 0.05))
    scaled = refine_planes(1000 * wavy_cone(noise=0.05), truth().transformed(scale=1000)).residuals
    assert (clean < 0.2 * noisy).all()
    np.testing.assert_allclose(scaled, 1000 * noisy, rtol=0.02)


def test_an_exact_plane_stays_where_it_is():
    square = np.stack(np.meshgrid(*[np.linspace(-1, 1, 9)] * 3), -1).reshape(-1, 3)  # its own image, exactly
    planes = Planes([[1.0, 0, 0], [0, 1, 0]], [[0, 0.3, 0.7], [0.0, 0, 0]])
    refined = refine_planes(square, planes)
    np.testing.assert_allclose(np.abs(refined.planes.normals), np.abs(planes.normals), atol=1e-4)
    np.testing.assert_allclose(np.abs(refined.planes.offsets), np.abs(planes.offsets), atol=1e-4)


def test_nothing_to_refine():
    assert not len(refine_planes(wavy_cone(50), Planes.empty()).planes)
    planes = truth()
    assert refine_planes(np.ones((9, 3)), planes).planes is planes
    with pytest.raises(ValueError, match="point 1 is not finite"):
        refine_planes(np.array([[0, 0, 0], [np.inf, 0, 0]]), planes)


def test_closed_form_eigenvectors():
    rng = np.random.default_rng(0)
    half = rng.normal(size=(300, 3, 3)) * np.array([1, 1, 0.01])[rng.integers(0, 3, 300), None, None]
    matrices = half @ half.transpose(0, 2, 1)
    expected = np.linalg.eigh(matrices)[1][:, :, 0]
    entries = torch.tensor(matrices[:, [0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]].T.copy())
    found = smallest_eigenvectors(entries).numpy()
    np.testing.assert_allclose(np.abs((found * expected).sum(1)), 1, atol=1e-6)
    assert torch.isfinite(smallest_eigenvectors(torch.zeros(6, 2, dtype=torch.float64))).all()


def test_system_is_the_derivative_of_the_residuals():
    surface = local_surface(torch.tensor(wavy_cone(300) - [5, 0, 0.8]).float(), 10, (0.5,))
    normals = torch.nn.functional.normalize(torch.tensor([[0.1, 1.0, 0.05]]), dim=-1)
    offsets, basis, rows = torch.tensor([0.02]), tangents(normals), torch.arange(300)
    matches = surface.neighbours.query(mirrored(surface.points, normals, offsets), 1)[1][..., 0]
    pairs = Pairs(surface, rows, matches)

    def right_side(step):
        turned = torch.nn.functional.normalize(normals + (step[:2, None] * basis[0]).sum(0), dim=-1)
        return pairs.system(turned, offsets + step[2], tangents(normals), 1e3)[1][0]

    matrix, right, _ = pairs.system(normals, offsets, basis, 1e3)
    step = -torch.linalg.solve(matrix[0], right[0]).float()
    assert right_side(step).norm() < 0.3 * right[0].norm()


def test_group_relations_and_closure():
    angles = torch.arange(5) * torch.pi / 5
    normals = torch.stack([torch.cos(angles), torch.sin(angles), 0 * angles], 1)
    offsets = normals @ torch.tensor([0.1, -0.2, 0.3])
    images, image_offsets = images_of_planes(normals, offsets)
    point = torch.tensor([0.1, -0.2, 0.7])
    np.testing.assert_allclose(images @ point, image_offsets, atol=1e-6)
    assert len(find_relations(normals, offsets, 1.0, 0.01).mirror) == 20
    more, more_offsets = closure(normals[:2], offsets[:2], 5.0, 9)
    assert len(more) == 2
    np.testing.assert_allclose((more @ normals.T).abs().amax(1), 1, atol=1e-6)
    np.testing.assert_allclose(more @ torch.tensor([0.1, -0.2, 0.3]), more_offsets, atol=1e-6)


def test_ends_of_a_density_with_scattered_points_beyond():
    rng = np.random.default_rng(1)
    heights = np.concatenate([rng.uniform(-1, 3, 3000), rng.uniform(-1.3, 3.9, 300)])
    middle = float(end_offset(torch.tensor(heights).float(), torch.ones(len(heights))))
    assert middle == pytest.approx(1.0, abs=0.01)
    assert abs(np.mean([heights.min(), heights.max()]) - 1) > 0.1
