"""Shapes made symmetric, completed and put upright, where the answer is known."""

import numpy as np
import pytest
import trimesh

from symshrec.geometry.averaging import symmetrised
from symshrec.geometry.completion import unobserved
from symshrec.geometry.frames import aligning_transform
from symshrec.geometry.residuals import asymmetry, mismatch
from symshrec.geometry.rotations import uniform_rotation
from symshrec.geometry.triangles import MeshSurface
from symshrec.planes import Planes

ACROSS_X = Planes([[1, 0, 0]], [[0, 0, 0]])


def turned(points, planes, seed=0):
    """Both in another pose, far from the origin, and how to come back from there."""
    rotation, shift = uniform_rotation(np.random.default_rng(seed)), np.array([900.0, -30, 4])
    back = lambda moved: (moved - shift) @ rotation  # noqa: E731
    return points @ rotation.T + shift, planes.transformed(rotation, shift), back


def test_a_box_with_a_corner_pulled_out_by_d_has_two_pulled_out_by_d_halves():
    box = trimesh.creation.box((2, 4, 6))
    corner = np.argmax(box.vertices @ [1, 1, 1])
    other = np.argmax(box.vertices @ [-1, 1, 1])
    vertices = box.vertices.copy()
    vertices[corner] += [0.2, 0.1, 0.3]
    points, planes, back = turned(vertices, ACROSS_X)
    result = back(symmetrised(points, planes.group().transforms, box.faces))
    expected = box.vertices.copy()
    expected[corner] += [0.1, 0.05, 0.15]
    expected[other] += [-0.1, 0.05, 0.15]
    np.testing.assert_allclose(result, expected, atol=1e-9)


def test_two_parallel_sheets_meet_half_way():
    rng = np.random.default_rng(0)
    sheets = np.concatenate(
        [rng.uniform(-1, 1, (3000, 3)) * [1, 1, 0] + np.array([[x, 0, z]]) for x, z in ((2, 0), (-2, 0.2))]
    )
    points, planes, back = turned(sheets, ACROSS_X)
    result = back(symmetrised(points, planes.group().transforms))
    inside = (np.abs(np.abs(sheets[:, 0]) - 2) < 0.9) & (np.abs(sheets[:, 1]) < 0.9)
    np.testing.assert_allclose(result[inside, 2], 0.1, atol=0.01)
    assert asymmetry(result, ACROSS_X)[0] < 0.03 * asymmetry(sheets, ACROSS_X)[0]


def test_a_symmetric_shape_stays_as_it_is_and_a_group_makes_the_whole_of_it_alike():
    box = trimesh.creation.box((2, 2, 3))
    planes = Planes([[1, 0, 0], [0, 1, 0], [1, 1, 0], [1, -1, 0], [0, 0, 1]], np.zeros((5, 3)))
    group = planes.group(4.0)
    assert group.name == "D4h"
    np.testing.assert_allclose(symmetrised(box.vertices, group.transforms, box.faces), box.vertices, atol=1e-12)
    bent = box.vertices * [1.2, 1, 1]
    result = symmetrised(bent, group.transforms, box.faces)
    np.testing.assert_allclose(np.abs(result), np.tile([1.1, 1.1, 1.5], (8, 1)), atol=1e-9)


def test_vertices_that_several_triangles_have_copies_of_stay_together():
    box = trimesh.creation.box((2, 4, 6))
    soup = box.vertices[box.faces].reshape(-1, 3)
    soup[np.linalg.norm(soup - [1, 2, 3], axis=1) < 1e-9] += [0.2, 0, 0]
    result = symmetrised(soup, ACROSS_X.group().transforms, np.arange(len(soup)).reshape(-1, 3))
    assert len(np.unique(result.round(9), axis=0)) == 8
    assert np.abs(result).max(axis=0) == pytest.approx([1.1, 2, 3])


def test_a_mesh_is_measured_exactly():
    sphere = trimesh.creation.icosphere(2)
    surface, rng = MeshSurface(sphere.vertices, sphere.faces), np.random.default_rng(0)
    points = rng.normal(size=(200, 3))
    corners = sphere.vertices[sphere.faces]
    weights = np.stack(np.meshgrid(*[np.linspace(0, 1, 40)] * 2), -1).reshape(-1, 2)
    weights = weights[weights.sum(1) <= 1]
    dense = (corners[:, :1] + weights @ (corners[:, 1:] - corners[:, :1])).reshape(-1, 3)
    brute = np.array([np.linalg.norm(dense - point, axis=1).min() for point in points])
    feet, distances, _ = surface.closest(points)
    np.testing.assert_allclose(distances, brute, atol=4e-3)  # of points 0.008 apart
    assert (distances <= brute + 1e-12).all()
    np.testing.assert_allclose(np.linalg.norm(feet - points, axis=1), distances)
    exact = mismatch(dense[::50], ACROSS_X, mesh=surface)
    assert exact.residuals[0] < 1e-12
    assert exact.asymmetries[0] < 1e-12


def ellipsoid(count=8000):
    """Even points on an ellipsoid with half axes 1, 1.4 and 2, and a knob at x = −1 that only one side has."""
    rows = np.arange(count) + 0.5
    z, turn = 1 - 2 * rows / count, np.pi * (3 - 5**0.5) * rows
    ball = np.stack([np.sqrt(1 - z * z) * np.cos(turn), np.sqrt(1 - z * z) * np.sin(turn), z], 1)
    knob = ball[::12] * 0.3 - np.array([1.25, 0, 0])
    points = ball * [1, 1.4, 2]
    outside = (((knob / [1, 1.4, 2]) ** 2).sum(1) > 1), (np.linalg.norm(points + np.array([1.25, 0, 0]), axis=1) > 0.3)
    return points[outside[1]], knob[outside[0]]


def test_a_cut_away_side_comes_back_and_a_knob_of_one_side_does_not():
    body, knob = ellipsoid()
    seen = body[body[:, 0] < 0.35]
    images = seen * [-1, 1, 1]
    filled = images[unobserved(seen, images)]
    assert np.abs((filled / [1, 1.4, 2]) @ np.eye(3)).max() <= 1 + 1e-9
    assert filled[:, 0].min() > 0.3
    spacing = 0.08
    whole = np.concatenate([seen, filled])
    gaps = np.linalg.norm(body[body[:, 0] > 0.35][:, None] - whole[None, ::1], axis=2).min(axis=1)
    hole = np.linalg.norm(body - [1.25, 0, 0], axis=1) < 0.45  # which the knob covers on the other side
    assert np.quantile(gaps[~hole[body[:, 0] > 0.35]], 0.99) < 2 * spacing
    both = np.concatenate([body, knob])
    assert unobserved(both, both * [-1, 1, 1]).sum() <= 5
    assert not unobserved(body, body[::2] + 1e-3).any()
    with pytest.raises(ValueError, match="7"):
        unobserved(body[:5], body)


@pytest.mark.parametrize("angle", [90, 60, 36])
def test_aligned_planes_are_x_0_and_contain_the_axis(angle):
    second = [np.cos(np.radians(angle)), np.sin(np.radians(angle)), 0]
    planes = Planes([[1, 0, 0], second, [0, 0, 1]], np.array([[0, 1, 2], np.cross([0, 0, 1], second), [3, 3, 0]]))
    points = np.random.default_rng(0).normal(size=(20, 3))
    points, planes, _ = turned(points, planes, angle)
    for count in (2, 3):
        transform = aligning_transform(planes[:count], points.mean(axis=0))
        assert np.linalg.det(transform[:3, :3]) == pytest.approx(1)
        moved = planes.transformed(transform[:3, :3], transform[:3, 3])
        np.testing.assert_allclose(np.abs(moved.normals[0]), [1, 0, 0], atol=1e-9)
        np.testing.assert_allclose(moved.offsets[:count], 0, atol=1e-9)
        if angle == 90:
            np.testing.assert_allclose(np.abs(moved.normals[1]), [0, 1, 0], atol=1e-9)
        assert abs(moved.normals[1, 2]) < 1e-9
        middle = transform[:3, :3] @ points.mean(axis=0) + transform[:3, 3]
        assert count == 3 or abs(middle[2]) < 1e-9


def test_an_aligned_shape_stays_as_it_is():
    planes = Planes(np.eye(3)[:2], np.zeros((2, 3)))
    np.testing.assert_allclose(aligning_transform(planes, np.zeros(3)), np.eye(4), atol=1e-12)
    flipped = Planes(-np.eye(3)[:2], np.zeros((2, 3)))
    np.testing.assert_allclose(aligning_transform(flipped, np.zeros(3)), np.eye(4), atol=1e-12)
    with pytest.raises(ValueError, match="no plane"):
        aligning_transform(Planes.empty(), np.zeros(3))
