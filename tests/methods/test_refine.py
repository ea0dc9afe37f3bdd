"""Refinement brings planes that are a little off to the true ones, and leaves alone what it cannot better."""

import numpy as np
import pytest
import torch

from symshrec.methods.fit import RefineSettings, refine_planes
from symshrec.methods.fit.alignment import Pairs
from symshrec.methods.fit.coupling import closure, find_relations, images_of_planes, orbit_means
from symshrec.methods.fit.density import Density, densities
from symshrec.methods.fit.ends import end_offset
from symshrec.methods.fit.frame import frame_of
from symshrec.methods.fit.likelihood import ascended, divergence
from symshrec.methods.fit.steps import stepped, tangents
from symshrec.methods.fit.surface import local_planes, smallest_eigenvectors
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
    assert refined.fit.max() == 1
    assert refined.fit.min() > 0.9
    np.testing.assert_array_equal(refined.planes.confidences, truth().confidences * refined.fit)


def test_a_true_plane_across_which_points_thin_out_keeps_its_confidence():
    """Eight times denser at one end of the y axis: the first plane, y = 0, mirrors the surface and not the density."""
    points = wavy_cone(8000)
    height = (points[:, 1] - points[:, 1].min()) / np.ptp(points[:, 1])
    points = points[np.random.default_rng(1).random(len(points)) < 8 ** (height - 1)]
    refined = refine_planes(points, off(truth(), 1, 0.01))
    assert refined.fit.min() > 0.7
    assert errors(refined.planes)[0] < 1


def test_a_plane_that_fits_much_worse_than_the_best_loses_its_confidence():
    between = np.deg2rad(30)  # halfway between two true planes, where a curve of odd symmetry is least like itself
    normals = np.vstack([truth().normals, [-np.sin(between), np.cos(between), 0.0]])
    given = Planes(normals, np.tile([5.0, 0.0, 0.0], (4, 1)), np.array([0.5, 0.5, 0.5, 0.99]))
    refined = refine_planes(wavy_cone(), given)
    assert refined.planes.confidences[3] < 0.1 < refined.planes.confidences[:3].min()


def test_an_exact_plane_stays_where_it_is():
    square = np.stack(np.meshgrid(*[np.linspace(-1, 1, 9)] * 3), -1).reshape(-1, 3)  # its own image, exactly
    planes = Planes([[1.0, 0, 0], [0, 1, 0]], [[0, 0.3, 0.7], [0.0, 0, 0]])
    refined = refine_planes(square, planes)
    np.testing.assert_allclose(np.abs(refined.planes.normals), np.abs(planes.normals), atol=1e-4)
    np.testing.assert_allclose(np.abs(refined.planes.offsets), np.abs(planes.offsets), atol=1e-4)


def test_a_plane_far_away_stays_and_the_others_move():
    planes = off(truth(), 1, 0.01)
    far = np.array([5.0, 0.0, 40.0])
    given = Planes(np.vstack([planes.normals, [0.0, 0.0, 1.0]]), np.vstack([planes.points, far]), np.ones(4))
    refined = refine_planes(wavy_cone(), given)
    np.testing.assert_array_equal(refined.kept, [False, False, False, True])
    np.testing.assert_array_equal(refined.planes.points[3], far)


def test_strays_do_not_matter():
    strays = np.array([[5.0, 0, 1e4], [-3e3, 2e3, 0]])
    refined = refine_planes(np.concatenate([wavy_cone(), strays]), off(truth(), 2, 0.02))
    angle, gap = errors(refined.planes)
    assert angle < 0.2
    assert gap < 0.01


def test_nothing_to_refine():
    assert not len(refine_planes(wavy_cone(50), Planes.empty()).planes)
    planes = truth()
    assert refine_planes(np.ones((9, 3)), planes).planes is planes
    with pytest.raises(ValueError, match="point 1 is not finite"):
        refine_planes(np.array([[0, 0, 0], [np.inf, 0, 0]]), planes)
    with pytest.raises(ValueError, match="neighbours is 0"):
        RefineSettings(neighbours=0)


def test_closed_form_eigenvectors():
    rng = np.random.default_rng(0)
    half = rng.normal(size=(300, 3, 3)) * np.array([1, 1, 0.01])[rng.integers(0, 3, 300), None, None]
    matrices = half @ half.transpose(0, 2, 1)
    expected = np.linalg.eigh(matrices)[1][:, :, 0]
    entries = torch.tensor(matrices[:, [0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]].T.copy())
    found = smallest_eigenvectors(entries).numpy()
    np.testing.assert_allclose(np.abs((found * expected).sum(1)), 1, atol=1e-6)
    assert torch.isfinite(smallest_eigenvectors(torch.zeros(6, 2, dtype=torch.float64))).all()


def test_pairs_solve_to_the_true_plane_on_exact_points():
    rng = np.random.default_rng(3)
    half = rng.uniform(-0.5, 0.5, (300, 3))
    x, y, _ = half.T
    half[:, 2] = 0.3 * np.cos(3 * x) * np.cos(4 * y)  # a surface, mirrored in x = 0
    points = torch.tensor(half).float()
    normal = np.stack([0.9 * np.sin(3 * x) * np.cos(4 * y), 1.2 * np.cos(3 * x) * np.sin(4 * y), np.ones(300)], 1)
    normals = torch.nn.functional.normalize(torch.tensor(normal).float(), dim=1)
    matches = (points * torch.tensor([-1.0, 1, 1]))[None, :, None]
    pairs = Pairs(points, normals, torch.ones(300), matches)
    plane, offset = torch.nn.functional.normalize(torch.tensor([[1.0, 0.03, -0.02]]), dim=1), torch.tensor([0.01])
    for _ in range(6):
        basis = tangents(plane)
        matrices, right, blind = pairs.system(plane, offset, basis, 1.0)
        plane, offset = stepped(plane, offset, basis, matrices, right, 1.0)
    np.testing.assert_allclose(plane, [[1, 0, 0]], atol=1e-4)
    assert abs(float(offset)) < 1e-4
    assert not blind.any()


def test_local_planes_of_a_plane_with_points_off_it():
    rng = np.random.default_rng(4)
    around = rng.uniform(-0.05, 0.05, (50, 16, 3))
    around[..., 2] = 0
    around[:, :2, 2] = 0.03
    normals, certainty = local_planes(torch.tensor(around).float(), (0.02, 0.01, 0.003))
    assert (normals[:, 2].abs() > 0.999).float().mean() > 0.9
    assert certainty.median() > 0.6
    off = local_planes(torch.tensor(around + np.array([0, 0, 0.02])).float(), (0.02, 0.01, 0.003))[1]
    assert off.median() < 0.1


def test_density_is_a_sum_of_bells():
    rng = np.random.default_rng(5)
    points = torch.tensor(rng.uniform(-0.3, 0.3, (400, 3))).float()
    density = Density(points, 0.05)
    places = torch.tensor(rng.uniform(-0.35, 0.35, (200, 3))).float()
    bells = torch.exp(-torch.cdist(places, points).square() / (2 * 0.05**2)).sum(1)
    bells = bells * (density.cell / 0.05) ** 3 / (2 * np.pi) ** 1.5
    assert np.corrcoef(density.at(places.T), bells)[0, 1] > 0.99
    assert float(density.at(places.T).mean()) == pytest.approx(float(bells.mean()), rel=0.05)
    assert (density.at(places.T + 5) < 1e-6).all()
    rest = Density(torch.cat([points[:7], points[8:]]), 0.05)
    same_grid = (rest.corner == density.corner).all() and rest.shape == density.shape
    assert same_grid
    np.testing.assert_allclose(density.of_others(points[7:8]), rest.at(points[7:8].T), atol=1e-4)


def test_slope_is_the_derivative_of_the_density():
    rng = np.random.default_rng(6)
    density = Density(torch.tensor(rng.normal(size=(300, 3)) * 0.1).float(), 0.06)
    places = torch.tensor(rng.normal(size=(3, 100)) * 0.1).float()
    values, slopes = density.with_slope(places)
    np.testing.assert_allclose(values, density.at(places), atol=1e-5)
    inside_a_cell, step = [], 1e-3 * density.cell
    for axis in range(3):
        ahead, behind = places.clone(), places.clone()
        ahead[axis] += step
        behind[axis] -= step
        difference = (density.at(ahead) - density.at(behind)) / (2 * step)
        inside_a_cell.append((difference - slopes[axis]).abs() < 0.02 * slopes.abs().max())
    assert torch.stack(inside_a_cell).float().mean() > 0.98  # but for the few that stand on a face of a cell


def test_likelihood_is_highest_at_a_symmetry_whatever_the_noise():
    points = frame_of(wavy_cone(4000, noise=0.08), 8192)
    normals, offsets = points.of(truth())
    density = Density(points.points, 0.03)
    turned = torch.nn.functional.normalize(normals + torch.tensor([0.0, 0.0, 0.08]), dim=1)
    at_truth = divergence(density, points.points, normals, offsets)
    assert at_truth.abs().max() < 0.02
    assert (divergence(density, points.points, turned, offsets) > at_truth + 0.02).all()
    climbed, places = ascended(density, points.points, turned, offsets + 0.03, 8, 0.1)
    assert float((climbed * normals).sum(1).abs().min()) > np.cos(np.deg2rad(0.7))
    assert float((places - offsets).abs().max()) < 0.01
    assert (divergence(density, points.points, climbed, places) < at_truth + 1e-3).all()


def test_refining_never_loses_fit():
    points = wavy_cone(noise=0.03)
    rng = np.random.default_rng(7)
    normals = rng.normal(size=(12, 3))
    given = Planes(
        normals / np.linalg.norm(normals, axis=1, keepdims=True), rng.normal(size=(12, 3)) * 0.1 + [5, 0, 0.8]
    )
    frame = frame_of(points, 8192)
    finest = densities(frame.points)[-1]
    before, after = (
        divergence(finest, frame.points, *frame.of(planes)) for planes in (given, refine_planes(points, given).planes)
    )
    assert (after <= before + 1e-5).all()
    assert (after < before - 0.01).any()


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


def test_orbits_share_their_values():
    angles = torch.arange(6) * torch.pi / 6
    normals = torch.stack([torch.cos(angles), torch.sin(angles), 0 * angles], 1)
    relations = find_relations(normals, torch.zeros(6), 1.0, 0.01)
    means = orbit_means(torch.tensor([0.0, 1.0, 0.0, 1.0, 0.3, 1.3]), relations)
    np.testing.assert_allclose(means, [0.1, 1.1] * 3, atol=1e-5)  # two orbits: every other plane
    assert len(relations.mirrored_in(torch.arange(6) == 2).mirror) == 5
    assert set(relations.among(torch.arange(6) % 3 == 0).mirror.tolist()) <= {0, 3}


def test_ends_of_a_density_with_scattered_points_beyond():
    rng = np.random.default_rng(1)
    heights = np.concatenate([rng.uniform(-1, 3, 3000), rng.uniform(-1.3, 3.9, 300)])
    middle = float(end_offset(torch.tensor(heights).float(), torch.ones(len(heights))))
    assert middle == pytest.approx(1.0, abs=0.01)
    assert abs(np.mean([heights.min(), heights.max()]) - 1) > 0.1
