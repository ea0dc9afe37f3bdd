"""The residual of a plane: nothing on exact symmetry, the mismatch elsewhere, in the cloud's unit."""

import numpy as np
import pytest

from symshrec.geometry.residuals import mirror_residuals
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
