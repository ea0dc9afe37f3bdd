"""Poses are those of the group that the configuration names."""

import numpy as np
import pytest

from symshrec.benchmark.config import PoseConfig, PoseGroup
from symshrec.benchmark.poses import draw_pose


@pytest.mark.parametrize("group", PoseGroup)
def test_poses_are_drawn_from_their_group(group):
    rng = np.random.default_rng(0)
    poses = [draw_pose(rng, PoseConfig(group)) for _ in range(400)]
    rotations = np.stack([each.rotation for each in poses])
    translations = np.stack([each.translation for each in poses])
    np.testing.assert_allclose(rotations @ rotations.transpose(0, 2, 1), np.tile(np.eye(3), (400, 1, 1)), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(rotations), 1)
    turned, shifted = (rotations != np.eye(3)).any((1, 2)), (translations != 0).any(1)
    assert np.abs(translations).max() <= 1
    expected = {PoseGroup.track: (200, 200), PoseGroup.xy_axes: (300, 200), PoseGroup.so3: (400, 400)}
    for seen, mean in zip((turned.sum(), shifted.sum()), expected.get(group, (0, 0)), strict=True):
        assert seen == mean if mean in (0, 400) else abs(seen - mean) < 50
    if group is PoseGroup.track:
        np.testing.assert_array_equal(rotations[:, 0], np.tile([1.0, 0.0, 0.0], (400, 1)))
        degrees = np.rad2deg(np.arctan2(rotations[:, 2, 1], rotations[:, 1, 1]))
        np.testing.assert_allclose(degrees, np.round(degrees), atol=1e-9)
        assert degrees.min() < -150
        assert degrees.max() > 150
    if group is PoseGroup.so3:
        assert np.abs(rotations.mean(0)).max() < 0.15


def test_a_pose_is_to_the_bit_a_product_and_a_sum():
    rng = np.random.default_rng(1)
    pose, points = draw_pose(rng, PoseConfig(PoseGroup.so3)), rng.normal(size=(1000, 3))
    np.testing.assert_array_equal(pose(points), points @ pose.rotation.T + pose.translation)
