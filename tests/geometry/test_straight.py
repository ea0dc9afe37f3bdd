"""A line is a line at any place, turn and unit, and what is a little thicker is none."""

import numpy as np
import pytest

from symshrec.geometry.rotations import uniform_rotation
from symshrec.geometry.straight import BLOCK, STRAIGHT, blocks, is_straight


@pytest.mark.parametrize("unit", [1e-200, 1, 1e200])
@pytest.mark.parametrize("thickness", [0.5, 2])
def test_thickness_decides(thickness, unit):
    rng = np.random.default_rng(0)
    points = rng.normal(size=(500, 3)) * [1, 0, 0]
    points[:, 1] = rng.normal(size=500)
    points[:, 1] -= points[:, 0] * (points[:, 0] @ points[:, 1]) / (points[:, 0] @ points[:, 0])
    points -= points.mean(0)
    points /= np.maximum(points.std(0), 1e-300)
    turned = (points * [1, thickness * STRAIGHT, 0]) @ uniform_rotation(rng).T
    assert is_straight(turned * unit, scale=unit) == (thickness < 1)
    assert is_straight(turned + 0.5) == (thickness < 1)
    assert not is_straight(turned, tolerance=thickness * STRAIGHT / 2)


def test_a_point_is_straight_and_a_triangle_is_not():
    assert is_straight(np.ones((1, 3)))
    assert is_straight(np.ones((7, 3)))
    assert not is_straight(np.eye(3))


def test_a_cloud_of_several_blocks_is_judged_whole():
    points = np.zeros((2 * BLOCK + 10, 3))
    points[:BLOCK, 0], points[BLOCK:, 1] = 1, 1  # each block alone is a point
    assert [len(block) for block in blocks(points, np.zeros(3))] == [BLOCK, BLOCK, 10]
    points[-10:, 2] = 1
    assert not is_straight(points)
    assert is_straight(points[:-10])
