"""Point groups of planes that are turned, moved, shuffled and noisy; of some of them; and of what makes none."""

import numpy as np
import pytest

from symshrec.geometry.rotations import uniform_rotation
from symshrec.planes import Planes, axis_angles, point_group
from symshrec.planes.reflections import closure, mirrors

ALL = ["C2v", "C3v", "C4v", "C5v", "C6v", "C12v", "D2h", "D3h", "D4h", "D6h", "D10h", "Td", "Oh", "Ih"]
CENTRE = np.array([300.0, -20.0, 7.0])


def set_of(name: str, seed: int = 0, noise_deg: float = 0.0, noise: float = 0.0) -> Planes:
    """The group's planes in any order and pose, with points near a centre far from the origin."""
    rng = np.random.default_rng(seed)
    normals = mirrors(name).normals @ uniform_rotation(rng).T
    normals = rng.permutation(normals) * rng.choice([-1, 1], (len(normals), 1))
    sideways = np.cross(normals, rng.normal(size=normals.shape))
    tilts = np.tan(np.radians(noise_deg)) * rng.uniform(-1, 1, (len(normals), 1))
    tilted = normals + tilts * sideways / np.linalg.norm(sideways, axis=1, keepdims=True)
    tilted /= np.linalg.norm(tilted, axis=1, keepdims=True)
    within = np.cross(tilted, rng.normal(size=normals.shape)) * 0.3
    return Planes(tilted, CENTRE + within + noise * rng.uniform(-1, 1, (len(normals), 1)) * tilted)


@pytest.mark.parametrize("name", ALL)
@pytest.mark.parametrize("noise", [0.0, 0.5])
def test_a_group_is_known_in_any_pose_order_and_with_noise(name, noise):
    for seed in range(3):
        planes = set_of(name, seed, noise, noise / 100)
        group = planes.group(diagonal=1.0)
        assert (group.name, group.complete) == (name, True)
        assert sorted(group.planes) == list(range(len(planes)))
        assert group.angle_deg <= 1.4 * noise + 1e-6
        assert len(group.elements) == len(closure(mirrors(name).normals))
        off = axis_angles(planes.normals, group.normals).min(axis=1)
        assert np.degrees(off.max()) <= group.angle_deg + 1e-6


@pytest.mark.parametrize("name", ["C4v", "D3h", "Oh", "Ih"])
def test_its_transforms_take_its_planes_to_one_another_about_the_centre(name):
    planes = set_of(name, 5)
    transforms = planes.group(1.0).transforms
    assert np.abs(transforms[0] - np.eye(4)).max() < 1e-12
    for transform in transforms[:: max(1, len(transforms) // 10)]:
        moved = planes.transformed(transform[:3, :3], transform[:3, 3])
        assert np.degrees(axis_angles(moved.normals, planes.normals).min(axis=1).max()) < 1e-4
        heights = np.abs(CENTRE @ transform[:3, :3].T + transform[:3, 3] - CENTRE)
        if name in ("Oh", "Ih", "D3h"):
            assert heights.max() < 1e-6


@pytest.mark.parametrize("name", ["C3v", "C6v", "D3h", "D4h", "Td", "Oh", "Ih"])
def test_what_is_missing_of_a_group_is_offered(name):
    planes = set_of(name, 2, 0.2)
    across = [row for row in range(len(planes)) if (np.abs(planes.normals[row] @ planes.normals.T) > 0.1).sum() == 1]
    for row in set(range(len(planes))) - set(across if name[0] == "D" else []):  # without it, the others make Cnv
        kept = planes[np.arange(len(planes)) != row]
        group = kept.group(1.0)
        assert (group.name, group.complete, group.outside) == (name, False, ())
        assert np.degrees(axis_angles(group.missing.normals, planes.normals[[row]])) < 0.6
        assert abs((group.missing.points - CENTRE) @ planes.normals[row]) < 0.01
        assert "no group at 1°: one seems missing of" in group.describe()


def test_two_mirrors_tell_the_others_by_their_angle():
    for fold in (3, 4, 5):
        normals = [[1, 0, 0], [np.cos(np.pi / fold), np.sin(np.pi / fold), 0]]
        group = point_group(normals, np.zeros((2, 3)))
        assert (group.name, len(group.missing)) == (f"C{fold}v", fold - 2)
    group = point_group([[1, 0, 0], [np.cos(0.5), np.sin(0.5), 0]], np.zeros((2, 3)))  # 28.6°
    assert (group.name, group.planes, group.outside) == ("", (), (0, 1))
    assert group.describe() == "2 planes; no group at 1°"


def test_none_and_one():
    assert Planes.empty().group().name == "C1"
    group = Planes([[0, 0, 2]], [[1, 2, 3]]).group(1.0)
    assert (group.name, group.axes, len(group.elements)) == ("Cs", (), 2)
    np.testing.assert_allclose(group.transforms[1] @ [5, 6, 7, 1], [5, 6, -1, 1])
    assert group.describe() == "point group Cs: one mirror plane"


def test_planes_that_do_not_meet_are_no_group_where_the_diagonal_is_known():
    planes = Planes(np.eye(3), CENTRE + np.eye(3))
    assert planes.group(1.0).name == "D2h"
    angles = np.pi * np.arange(3) / 3
    normals = np.stack([np.cos(angles), np.sin(angles), 0 * angles], 1)
    apart = Planes(normals, 0.05 * normals * [[1], [-1], [1]])  # a triangle between them
    assert apart.group().name == "C3v"
    assert apart.group(1.0).name != "C3v"
    assert apart.group(100.0).name == "C3v"


def test_a_plane_that_does_not_belong_is_named():
    planes = set_of("D4h", 1)
    stray = Planes(np.concatenate([planes.normals, [[0.3, 0.5, 0.812]]]), np.concatenate([planes.points, [CENTRE]]))
    group = stray.group(1.0)
    assert (group.name, group.outside, group.complete) == ("D4h", (5,), False)
    assert group.describe().endswith("Plane 6 does not belong to it.")


@pytest.mark.parametrize("tolerance", [0.3, 1.0])
def test_planes_off_by_more_than_the_tolerance_are_not_taken(tolerance):
    planes = set_of("C4v", 3)
    turned = planes.normals[0] * np.cos(np.radians(4 * tolerance))
    axis = np.cross(planes.normals[0], planes.normals[1])
    turned = turned + np.sin(np.radians(4 * tolerance)) * np.cross(axis / np.linalg.norm(axis), planes.normals[0])
    off = Planes(np.concatenate([turned[None], planes.normals[1:]]), planes.points)
    assert not off.group(angle_deg=tolerance).complete
    assert off.group(angle_deg=5.0 if tolerance == 1 else 1.2).complete


def spread(count: int, seed: int) -> np.ndarray:
    """Angles over half a turn, at least half their mean distance apart."""
    return np.pi * (np.arange(count) + np.random.default_rng(seed).uniform(0, 0.5, count)) / count


@pytest.mark.parametrize(("count", "across"), [(8, False), (22, True), (36, False)])
def test_many_planes_through_one_axis_are_a_surface_of_revolution(count, across):
    for seed in range(4):
        angles, rotation = spread(count, seed), uniform_rotation(np.random.default_rng(seed))
        normals = np.stack([np.cos(angles), np.sin(angles), 0 * angles], 1)
        normals = np.concatenate([normals, [[0, 0, 1]]]) if across else normals
        group = Planes(normals @ rotation.T, np.tile(CENTRE, (len(normals), 1))).group(1.0)
        assert (group.name, group.continuous) == ("D∞h" if across else "C∞v", True)
        ((direction, order),) = group.axes
        assert order == 0
        assert abs(direction @ rotation[:, 2]) > 1 - 1e-9
        assert f"{count} planes through one axis" in group.describe()
        assert "surface of revolution (axis" in group.describe()


def test_many_planes_through_one_point_are_a_sphere():
    normals = np.random.default_rng(0).normal(size=(30, 3))
    group = Planes(normals, np.tile(CENTRE, (30, 1))).group(1.0)
    assert group.name == "Kh"
    np.testing.assert_allclose(group.centre, CENTRE)
    assert "sphere" in group.describe()
    scattered = Planes(normals, np.random.default_rng(1).uniform(-1, 1, (30, 3))).group(1.0)
    assert scattered.name != "Kh"


@pytest.mark.parametrize("wrong", [{"angle_deg": 0.0}, {"angle_deg": 9.0}, {"distance": 0.0}, {"diagonal": -1.0}])
def test_a_tolerance_out_of_range_is_refused(wrong):
    with pytest.raises(ValueError, match=next(iter(wrong))):
        point_group(np.eye(3), np.zeros((3, 3)), **wrong)
