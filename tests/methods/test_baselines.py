"""The baselines: all planes of a box wherever it lies, few on a shape without, and nothing that depends on the pose."""

import numpy as np
import pytest
import torch

from symshrec.geometry.rotations import uniform_rotation
from symshrec.methods.baselines import pca_icp, ransac
from symshrec.methods.baselines.icp import Target, polished
from symshrec.methods.baselines.module import PcaIcp, Ransac
from symshrec.planes import Planes, axis_angles
from tests.methods.likeness import assert_same_planes

FIND = {"pca_icp": pca_icp.detect_planes, "ransac": ransac.detect_planes}


def box(count=3000, seed=0):
    """Points on the faces of a box, three by two by one, in equal density."""
    rng = np.random.default_rng(seed)
    size = np.array([3.0, 2.0, 1.0])
    across = rng.choice(3, count, p=(1 / size) / (1 / size).sum())
    points = rng.uniform(-0.5, 0.5, (count, 3))
    points[np.arange(count), across] = rng.choice([-0.5, 0.5], count)
    return points * size


def scalene(count=3000, seed=0):
    """Points on the faces of a tetrahedron with six different edges: no mirror plane."""
    corners = np.array([[0, 0, 0], [3, 0, 0], [0.6, 2, 0], [1.9, 0.5, 1.4]])
    faces = corners[[[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]]]
    areas = np.linalg.norm(np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0]), axis=1)
    rng = np.random.default_rng(seed)
    weights = rng.dirichlet(np.ones(3), count)
    return np.einsum("nc,ncd->nd", weights, faces[rng.choice(4, count, p=areas / areas.sum())])


@pytest.mark.parametrize("find", FIND.values(), ids=FIND)
def test_a_boxs_planes_are_found_at_any_pose_and_scale(find):
    rng = np.random.default_rng(7)
    for scale in (1e-3, 200.0):
        rotation, translation = uniform_rotation(rng), scale * rng.uniform(-5, 5, 3)
        found = find(scale * box() @ rotation.T + translation)
        true = Planes(np.eye(3), np.zeros((3, 3))).transformed(rotation, translation)
        sure = found[found.confidences >= 0.9]
        assert len(sure) == 3
        angles = np.rad2deg(axis_angles(true.normals, sure.normals))
        assert angles.min(axis=1).max() < 1
        nearest = sure[angles.argmin(axis=1)]
        gaps = np.einsum("kd,kd->k", nearest.points - true.points, true.normals)
        assert np.abs(gaps).max() < 0.01 * scale * np.sqrt(14)


@pytest.mark.parametrize("find", FIND.values(), ids=FIND)
def test_a_shape_without_a_plane_has_no_sure_one(find):
    found = find(scalene())
    assert ((found.confidences >= 0) & (found.confidences < 0.85)).all()


@pytest.mark.parametrize("find", FIND.values(), ids=FIND)
def test_planes_move_with_the_cloud_and_know_no_order(find):
    points = box(2000)
    planes = find(points)
    order = np.random.default_rng(1).permutation(len(points))
    assert_same_planes(find(points[order]), planes, atol=1e-9)
    rotation, translation = uniform_rotation(np.random.default_rng(2)), np.array([1.0, -2, 0.5])
    moved = find(3 * points @ rotation.T + translation)
    assert_same_planes(moved[:3], planes.transformed(rotation, translation, 3)[:3], atol=2e-3)


@pytest.mark.parametrize("find", FIND.values(), ids=FIND)
def test_what_cannot_be_used_is_named_and_what_has_no_plane_has_none(find):
    with pytest.raises(ValueError, match=r"points have shape \(5, 2\)"):
        find(np.zeros((5, 2)))
    points = box(10)
    points[3, 1] = np.nan
    with pytest.raises(ValueError, match="point 3 is not finite"):
        find(points)
    assert len(find(np.zeros((50, 3)))) == 0
    assert len(find(np.eye(3))) == 0


def test_icp_finds_the_exact_plane_of_an_exact_cloud_from_five_degrees_off():
    half = box(400)
    points = np.concatenate([half, half * [-1, 1, 1]])
    target = Target.of(points, 10_000, 2.0)
    start = np.array([np.cos(np.deg2rad(5)), np.sin(np.deg2rad(5)), 0])
    normal, offset = polished(target, start, 0.03, len(points), 100, 0.9)
    np.testing.assert_allclose(np.abs(normal), [1, 0, 0], atol=1e-6)
    assert abs(offset) < 1e-6
    assert target.support(normal[None], np.array([offset])) == 1


@pytest.mark.parametrize(("method", "find"), [(PcaIcp, FIND["pca_icp"]), (Ransac, FIND["ransac"])])
def test_the_method_is_the_function_and_refuses_what_its_settings_refuse(method, find):
    points = torch.from_numpy(box(500)).float()
    assert_same_planes(method().detect(points), find(points.numpy()), atol=1e-12)
    assert method(method.Settings(count_threshold=0.4)).count_threshold == 0.4
    with pytest.raises(ValueError, match="kept is 2"):
        method.Settings(kept=2)
