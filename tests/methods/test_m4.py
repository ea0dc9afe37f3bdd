"""M4: the planes of clouds whose symmetry is known, in any order and pose, and no crash on clouds without."""

import json
from pathlib import Path

import numpy as np
import pytest
import torch

from symshrec.benchmark.cloud import Labels
from symshrec.data.batch import Batch
from symshrec.methods.m4.confidence import confidences
from symshrec.methods.m4.module import M4
from symshrec.methods.m4.pipeline import SURE, detect_planes
from symshrec.methods.m4.search import hemisphere
from symshrec.methods.m4.settings import CALIBRATION, SURFACE_CALIBRATION, M4Settings
from symshrec.planes import Planes, axis_angles
from symshrec.runs.config import load
from symshrec.speed.plain.m4 import detect_planes as plain_planes


def petal_cone(count=2500, petals=4, noise=0.0, seed=0):
    """A cone over ρ = 2 + cos(petals · u): mirror planes through the z axis every π/petals; half the points noisy."""
    rng = np.random.default_rng(seed)
    u, s = rng.uniform(-np.pi, np.pi, count), np.sqrt(rng.uniform(0, 1, count))
    radius = (2 + np.cos(petals * u)) / 3
    points = np.stack([s * radius * np.cos(u), s * radius * np.sin(u), 1.3 * s], axis=1)
    points[::2] += noise * rng.normal(size=points[::2].shape)
    return points


def petal_planes(petals):
    angles = np.arange(petals) * np.pi / petals
    return Planes(np.stack([-np.sin(angles), np.cos(angles), 0 * angles], axis=1), np.zeros((petals, 3)))


def box_surface(count=3000, seed=1):
    """The surface of a 1 × 2 × 3 box about (4, −1, 2), points even over it: three mirror planes."""
    rng = np.random.default_rng(seed)
    sizes = np.array([1.0, 2.0, 3.0])
    points = rng.uniform(-0.5, 0.5, (count, 3))
    axis = rng.choice(3, count, p=(1 / sizes) / (1 / sizes).sum())
    points[np.arange(count), axis] = rng.choice([-0.5, 0.5], count)
    return points * sizes + [4, -1, 2]


def sure(planes, threshold=0.5):
    return planes[planes.confidences >= threshold]


def assert_are(planes, expected, angle_deg, distance):
    """As many planes as expected, each within the tolerances of a different one."""
    assert len(planes) == len(expected)
    angles = np.rad2deg(axis_angles(planes.normals, expected.normals))
    match = angles.argmin(1)
    assert sorted(match) == list(range(len(expected)))
    assert angles.min(1).max() < angle_deg
    gaps = np.einsum("kd,kd->k", planes.points - expected.points[match], expected.normals[match])
    assert np.abs(gaps).max() < distance


@pytest.mark.parametrize(("petals", "noise"), [(1, 0.0), (3, 0.03), (9, 0.0), (12, 0.0)])
def test_planes_of_a_cone_over_a_petal(petals, noise):
    points = petal_cone(5000 if petals > 4 else 2500, petals, noise)
    assert_are(sure(detect_planes(points)), petal_planes(petals), 0.5, 0.01)


def test_planes_of_a_box_and_its_centre():
    expected = Planes(np.eye(3), np.full((3, 3), [4.0, -1.0, 2.0]))
    assert_are(sure(detect_planes(box_surface())), expected, 0.3, 0.01)


def test_a_plane_across_which_density_grows_fivefold_stands_beside_those_that_density_is_sure_of():
    points = box_surface(40_000)
    heights = points[:, 0]
    share = (heights - heights.min()) / np.ptp(heights)
    uneven = points[np.random.default_rng(0).random(len(points)) < 5.0 ** (share - 1)][:6000]
    planes = detect_planes(uneven)
    assert_are(sure(planes), Planes(np.eye(3), np.full((3, 3), [4.0, -1.0, 2.0])), 0.5, 0.01)
    assert planes.confidences.max() >= SURE


def test_offset_of_a_cylinder_comes_from_its_ends():
    rng = np.random.default_rng(2)
    u = rng.uniform(-np.pi, np.pi, 3000)
    radius = (2 + np.cos(3 * u)) / 3
    points = np.stack([radius * np.cos(u), radius * np.sin(u), rng.uniform(0, 2, 3000)], axis=1)
    planes = sure(detect_planes(points))
    middle = planes[np.abs(planes.normals[:, 2]) > 0.99]
    assert len(middle) == 1
    assert middle.points[0] @ middle.normals[0] * np.sign(middle.normals[0, 2]) == pytest.approx(1.0, abs=0.005)


def test_order_changes_nothing_and_pose_next_to_nothing():
    points = petal_cone(noise=0.02)
    planes = detect_planes(points)
    shuffled = detect_planes(np.random.default_rng(0).permutation(points))
    np.testing.assert_array_equal(planes.normals, shuffled.normals)
    np.testing.assert_array_equal(planes.confidences, shuffled.confidences)
    rotation, _ = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))
    posed = detect_planes(7 * points @ rotation.T + [30, -20, 10])
    assert_are(sure(posed), sure(planes).transformed(rotation, [30, -20, 10], 7), 0.2, 0.05)


def test_neither_rounding_nor_a_far_position_costs_accuracy():
    points = petal_cone(noise=0.02)
    planes = detect_planes(points)
    for moved in (points + 1e-9 * np.random.default_rng(6).normal(size=points.shape), points + 1e6):
        found = detect_planes(moved)
        assert np.rad2deg(axis_angles(found.normals, planes.normals).diagonal()).max() < 1e-3
        np.testing.assert_allclose(found.confidences, planes.confidences, atol=1e-3)


def test_tensor_and_repeated_points_give_the_same_planes():
    points = petal_cone(1500)
    planes = detect_planes(points)
    np.testing.assert_array_equal(planes.normals, detect_planes(torch.from_numpy(points)).normals)
    np.testing.assert_array_equal(planes.normals, detect_planes(np.concatenate([points, points[:400]])).normals)


def test_a_point_repeated_very_often_hides_no_other():
    points = np.concatenate([petal_cone(2500, 3), np.zeros((40_000, 3))])  # as a depth camera gives what it did not see
    assert_are(sure(detect_planes(points)), petal_planes(3), 0.5, 0.01)


def test_strays_far_away_make_no_planes_and_hide_none():
    strays = np.array([[0.0, 0, 1e4], [-300.0, 200, 0]])
    assert_are(sure(detect_planes(np.concatenate([petal_cone(2500, 3), strays]))), petal_planes(3), 0.5, 0.01)


def test_far_clusters_are_a_cloud_too():
    rng = np.random.default_rng(11)
    for count in (2, 3, 5):
        centres = 10 * rng.normal(size=(count, 3))
        planes = detect_planes(np.repeat(centres, 12, axis=0) + 0.01 * rng.normal(size=(12 * count, 3)))
        assert np.isfinite(planes.confidences).all()


def test_an_asymmetric_cloud_has_no_plane_above_one_half():
    rng = np.random.default_rng(3)
    u, v = rng.uniform(0, 1, (2, 4000))
    points = np.stack([3 * u, v * (1 + u**2), 0.8 * np.sin(4 * u + 2 * v) + u * v + v**3], axis=1)
    assert not len(sure(detect_planes(points)))


def icosahedron(count=6000, seed=5):
    """Points spread over the faces of an icosahedron: 15 mirror planes, each across one of its 30 edges."""
    golden = (1 + 5**0.5) / 2
    corners = np.array([(0, a, b * golden) for a in (-1, 1) for b in (-1, 1)])
    corners = np.concatenate([np.roll(corners, turn, axis=1) for turn in range(3)])
    apart = np.linalg.norm(corners[:, None] - corners, axis=-1)
    edges = np.argwhere(np.triu(np.abs(apart - 2) < 1e-6))
    faces = [(i, j, k) for i, j in edges for k in range(j + 1, 12) if max(apart[i, k], apart[j, k]) < 2.01]
    rng = np.random.default_rng(seed)
    chosen = corners[np.array(faces)[rng.integers(len(faces), size=count)]]  # (N, 3 corners, 3)
    normals = corners[edges[:, 0]] - corners[edges[:, 1]]
    once = [row for row in range(30) if all(abs(normals[row] @ normals[other]) < 3.99 for other in range(row))]
    return (rng.dirichlet(np.ones(3), count)[..., None] * chosen).sum(1), Planes(normals[once], np.zeros((15, 3)))


def test_all_planes_of_an_icosahedron():
    points, expected = icosahedron()
    assert_are(sure(detect_planes(points)), expected, 1.0, 0.03)


@pytest.mark.parametrize(
    "points",
    [
        np.zeros((0, 3)),
        np.ones((1, 3)),
        np.ones((500, 3)),
        np.linspace(0, 1, 300)[:, None] * [1.0, 2.0, 3.0],
        np.eye(3),
    ],
    ids=["empty", "one point", "one point repeated", "line", "three points"],
)
def test_too_little_to_mirror_has_no_planes(points):
    assert not len(detect_planes(points))


@pytest.mark.parametrize("kind", ["sphere", "cylinder", "patch", "few", "ball"])
def test_degenerate_clouds_give_some_separate_finite_planes(kind):
    rng = np.random.default_rng(4)
    directions = rng.normal(size=(1500, 3))
    clouds = {
        "sphere": directions / np.linalg.norm(directions, axis=1, keepdims=True),
        "cylinder": np.column_stack([directions[:, :2] / np.linalg.norm(directions[:, :2], axis=1, keepdims=True),
                                     rng.uniform(-1, 1, 1500)]),
        "patch": np.column_stack([rng.uniform(0, 1, (800, 2)), np.zeros(800)]),
        "few": rng.normal(size=(5, 3)),
        "ball": rng.normal(size=(100, 3)),
    }  # fmt: skip
    planes = detect_planes(clouds[kind])
    assert len(planes) <= M4Settings().max_planes
    angles = np.rad2deg(axis_angles(planes.normals, planes.normals)) + 90 * np.eye(len(planes))
    assert angles.min(initial=90) > 4.99


def test_errors_name_what_is_wrong():
    with pytest.raises(ValueError, match=r"points have shape \(5, 2\)"):
        detect_planes(np.zeros((5, 2)))
    points = petal_cone(100)
    points[7, 1] = np.nan
    with pytest.raises(ValueError, match="point 7 is not finite"):
        detect_planes(points)
    with pytest.raises(ValueError, match="separation_deg is -1"):
        M4Settings(separation_deg=-1)


def test_module_names_the_failing_cloud_and_agrees_with_the_function():
    clouds = [petal_cone(600).astype(np.float32), np.full((5, 3), np.nan, dtype=np.float32)]

    def batch_of(count):
        return Batch(
            points=torch.from_numpy(np.concatenate(clouds[:count])),
            lengths=torch.tensor([len(each) for each in clouds[:count]]),
            truth=[None] * count,
            labels=[Labels()] * count,
            positions=list(range(count)),
            ids=list(range(count)),
            names=["good", "bad"][:count],
            diagonals=torch.ones(count, dtype=torch.float64),
        )

    np.testing.assert_array_equal(M4().planes_of(batch_of(1))[0].normals, detect_planes(clouds[0]).normals)
    with pytest.raises(ValueError, match="cloud bad: point 0 is not finite"):
        M4().planes_of(batch_of(2))


def test_hemisphere_is_even_and_half():
    directions, around = hemisphere(400)
    np.testing.assert_allclose(directions.norm(dim=1), 1, rtol=1e-6)
    angles = np.rad2deg(axis_angles(directions.numpy().astype(float), directions.numpy().astype(float)))
    np.fill_diagonal(angles, 90)
    assert angles.min(1).max() < 8
    tried = np.random.default_rng(0).normal(size=(500, 3))
    tried /= np.linalg.norm(tried, axis=1, keepdims=True)
    assert np.rad2deg(axis_angles(tried, directions.numpy().astype(float))).min(1).max() < 6.5
    assert all(np.isin(angles.argmin(1)[row], around[row]) for row in range(400))


def test_confidence_falls_with_the_divergence_and_forgives_sparse_clouds():
    divergences = torch.tensor([0.0, 0.02, 0.06, 0.3])
    dense, sparse = (confidences(divergences, count, CALIBRATION) for count in (6400, 400))
    assert (dense.diff() < 0).all()
    assert (sparse > dense).all()
    assert dense[0] > 0.9
    assert dense[3] < 0.01
    with pytest.raises(ValueError, match="calibration has 2 numbers, expected 4"):
        M4Settings(calibration=(1.0, 2.0))


def test_the_calibration_is_the_recorded_one():
    record = json.loads((Path(__file__).parents[2] / "results" / "calibration.json").read_text())
    assert tuple(record["calibration"]) == CALIBRATION
    by_surface = json.loads((Path(__file__).parents[2] / "results" / "surface_calibration.json").read_text())
    assert tuple(by_surface["surface_calibration"]) == SURFACE_CALIBRATION
    assert load(["method=m4"]).method.calibration == record["calibration"]


def test_the_plain_version_finds_the_same_planes():
    points = petal_cone(1500, 3)
    planes = plain_planes(points, directions=600, steps=10)
    assert_are(sure(planes), petal_planes(3), 0.5, 0.01)
