"""Planes against definitions: reflections, motions, and refusals."""

import numpy as np
import pytest

from symshrec.planes import PackedPlanes, Planes, axis_angles


def random_planes(count: int, seed: int = 0) -> Planes:
    rng = np.random.default_rng(seed)
    return Planes(rng.normal(size=(count, 3)), rng.normal(size=(count, 3)), rng.uniform(size=count))


def test_mirror_is_the_householder_reflection_and_an_involution():
    planes, points = random_planes(5), np.random.default_rng(1).normal(size=(40, 3))
    mirrored = planes.mirror(points)
    for k, (normal, point) in enumerate(zip(planes.normals, planes.points, strict=True)):
        householder = np.eye(3) - 2 * np.outer(normal, normal)
        np.testing.assert_allclose(mirrored[k], (points - point) @ householder.T + point, atol=1e-12)
        np.testing.assert_allclose(planes[k].mirror(mirrored[k])[0], points, atol=1e-12)


def test_transformed_planes_mirror_the_transformed_cloud():
    rng = np.random.default_rng(2)
    rotation, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    translation, scale = rng.normal(size=3), 2.5
    planes, points = random_planes(4), rng.normal(size=(30, 3))
    moved = planes.transformed(rotation, translation, scale).mirror(scale * points @ rotation.T + translation)
    np.testing.assert_allclose(moved, scale * planes.mirror(points) @ rotation.T + translation, atol=1e-12)


def test_canonical_planes_are_the_same_planes_whatever_the_sign():
    planes = random_planes(6)
    flipped = Planes(-planes.normals, planes.points, planes.confidences)
    np.testing.assert_array_equal(planes.canonical().normals, flipped.canonical().normals)
    points = np.random.default_rng(3).normal(size=(10, 3))
    np.testing.assert_allclose(planes.canonical().mirror(points), planes.mirror(points), atol=1e-12)
    assert len(Planes.empty().canonical()) == 0


def test_ranking_is_descending_and_stable():
    planes = Planes(np.eye(3)[[0, 1, 2, 0]], np.arange(12.0).reshape(4, 3), [0.5, 0.9, 0.5, 0.9])
    np.testing.assert_array_equal(planes.ranked().points[:, 0], [3, 9, 0, 6])


def test_rebuilding_planes_changes_no_bit():
    planes = random_planes(500)
    np.testing.assert_array_equal(planes[np.arange(500)].normals, planes.normals)


def test_angles_ignore_sign_and_resolve_the_smallest():
    tilt = 1e-7
    tilted = np.array([[np.cos(tilt), np.sin(tilt), 0.0]])
    assert axis_angles(np.array([[-1.0, 0, 0]]), tilted)[0, 0] == pytest.approx(tilt, rel=1e-6)
    assert axis_angles(np.eye(3)[:1], np.eye(3)[1:2])[0, 0] == pytest.approx(np.pi / 2)


def test_packing_keeps_every_cloud_even_the_empty_ones():
    clouds = [random_planes(3), Planes.empty(), random_planes(1, seed=5)]
    packed = PackedPlanes.pack(clouds)
    np.testing.assert_array_equal(packed.counts, [3, 0, 1])
    for before, after in zip(clouds, (packed[i] for i in range(3)), strict=True):
        np.testing.assert_array_equal(before.points, after.points)
    assert len(PackedPlanes.pack([])) == 0


@pytest.mark.parametrize(
    ("normals", "points", "confidences", "message"),
    [
        ([[1, 0, 0]], [[0, 0]], None, "points have shape"),
        ([[1, 0]], [[0, 0, 0]], None, "normals have shape"),
        ([[1, 0, 0], [0, 0, 0]], np.zeros((2, 3)), None, "normals row 1 has zero length"),
        ([[1, 0, 0]], [[0, np.nan, 0]], None, "points row 0 is not finite"),
        ([[1, 0, 0]], [[0, 0, 0]], [np.nan], "confidences row 0 is not finite"),
    ],
)
def test_unusable_planes_are_refused_by_name(normals, points, confidences, message):
    with pytest.raises(ValueError, match=message):
        Planes(normals, points, confidences)
