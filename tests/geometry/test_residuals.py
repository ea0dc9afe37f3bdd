"""The residual of a plane: nothing on exact symmetry, the mismatch elsewhere, in the cloud's unit."""

import numpy as np
import pytest

from symshrec.geometry.residuals import asymmetry, mirror_correspondences, mirror_deviations, mirror_residuals
from symshrec.planes import Planes

ACROSS_X = Planes([[1, 0, 0]], [[0, 0, 0]])


def square(count, seed=0):
    """Random points on a flat square of side 2."""
    return np.random.default_rng(seed).uniform(-1, 1, size=(count, 3)) * [1, 1, 0]


def test_exact_planes_have_no_residual_though_no_point_meets_another():
    assert mirror_residuals(square(3000), ACROSS_X)[0] < 1e-3
    paired = np.concatenate([square(500), square(500) * [-1, 1, 1]]) + np.array([0, 0, 0.3])
    assert mirror_residuals(paired, ACROSS_X)[0] < 1e-12


def test_two_parallel_sheets_are_told_their_distance():
    right, left = square(2000) + np.array([2, 0, 0]), square(2000, 1) + np.array([-2, 0, 0.25])
    sheets = np.concatenate([right, left])
    assert mirror_residuals(sheets, ACROSS_X)[0] == pytest.approx(0.25, rel=0.01)


def test_what_sticks_out_is_measured_to_the_edge():
    shifted = square(4000) + np.array([0.5, 0, 0])
    assert mirror_residuals(shifted, ACROSS_X)[0] == pytest.approx(0.25, rel=0.1)  # half sticks out, by 0.5 on average


def test_it_moves_turns_and_scales_with_the_cloud():
    rng = np.random.default_rng(0)
    points, planes = rng.normal(size=(400, 3)), Planes(rng.normal(size=(4, 3)), rng.normal(size=(4, 3)))
    rotation = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    moved = mirror_residuals(7 * points @ rotation.T + 1e5, planes.transformed(rotation, np.full(3, 1e5), 7))
    np.testing.assert_allclose(moved, 7 * mirror_residuals(points, planes), rtol=1e-6)


def test_few_points_many_points_and_none():
    assert mirror_residuals(np.array([[1.0, 0, 0]]), ACROSS_X) == pytest.approx([2.0])
    assert mirror_residuals(np.array([[1.0, 0, 0], [-1, 0, 0]]), ACROSS_X) == pytest.approx([0.0])
    assert mirror_residuals(square(10), Planes.empty()).shape == (0,)
    thinned = mirror_residuals(square(5000), ACROSS_X, limit=1000)
    assert thinned[0] < 3e-3
    assert thinned == mirror_residuals(square(5000), ACROSS_X, limit=1000)
    for wrong in (np.zeros((0, 3)), np.zeros((4, 2))):
        with pytest.raises(ValueError, match="expected"):
            mirror_residuals(wrong, ACROSS_X)


def test_duplicates_weigh_but_do_not_change_the_surface():
    points = square(800) + np.random.default_rng(1).normal(scale=0.01, size=(800, 3))
    once, twice = (mirror_residuals(np.repeat(points, times, axis=0), ACROSS_X) for times in (1, 2))
    np.testing.assert_allclose(twice, once, rtol=1e-12)


def bumped(height, count=6000):
    """A sphere of radius 1 with one bump at x = 1, and which of its points are on it."""
    points = np.random.default_rng(0).normal(size=(count, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    away = np.arccos(np.clip(points[:, 0], -1, 1))
    return points * (1 + height * np.exp(-((away / 0.4) ** 2)))[:, None], away


def test_a_bump_stands_out_by_its_height_and_lacks_on_the_other_side():
    for height in (0.1, -0.1):
        points, away = bumped(height)
        planes = Planes([[1, 0, 0], [0, 1, 0]], np.full((2, 3), 500.0) * [[0, 1, 1], [1, 0, 1]])
        across, along = mirror_deviations(points + np.array([0, 0, 500.0]), planes)
        assert across[away < 0.05].mean() == pytest.approx(height, abs=0.01)
        assert across[away > np.pi - 0.05].mean() == pytest.approx(-height, abs=0.01)
        assert np.quantile(np.abs(across[(away > 1.2) & (away < np.pi - 1.2)]), 0.99) < 0.01
        assert np.abs(along).mean() < 0.003


def test_the_asymmetry_index_is_0_for_perfect_and_a_known_share_of_the_diagonal():
    points = square(500) + np.array([0, 0, 0.3])
    paired = np.concatenate([points, points * [-1, 1, 1]])
    assert asymmetry(paired, ACROSS_X)[0] < 1e-12
    sheets = np.concatenate([square(3000) + np.array([2, 0, 0]), square(3000, 1) + np.array([-2, 0, 0.25])])
    known = 0.25 / np.linalg.norm(np.ptp(sheets, axis=0))
    assert asymmetry(sheets, ACROSS_X)[0] == pytest.approx(known, rel=0.01)
    assert asymmetry(50 * sheets + 7, ACROSS_X.transformed(scale=50, translation=[7, 7, 7])) == pytest.approx(
        known, rel=0.01
    )


def test_correspondences_are_the_nearest_points_and_their_own_inverse_where_all_are_paired():
    points = np.random.default_rng(2).normal(size=(300, 3)) + np.array([4, 0, 0])
    paired = np.concatenate([points, points * [-1, 1, 1]])
    partners, distances = mirror_correspondences(paired, ACROSS_X)
    assert partners.tolist() == [[*range(300, 600), *range(300)]]
    assert distances.max() == 0
    assert [each.shape for each in mirror_correspondences(paired, Planes.empty())] == [(0, 600)] * 2
    assert mirror_deviations(paired, Planes.empty()).shape == (0, 600)
    for measure in (mirror_correspondences, mirror_deviations, asymmetry):
        with pytest.raises(ValueError, match="expected"):
            measure(np.zeros((4, 2)), ACROSS_X)
