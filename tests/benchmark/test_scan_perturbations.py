"""P10–P15: the densities asked for, only what can be seen, what goes, the floor below, and the one plane that stays."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from symshrec.benchmark.cloud import FAMILIES
from symshrec.benchmark.config import BenchmarkConfig, NoiseConfig, ScanConfig
from symshrec.benchmark.perturbations import PERTURBATIONS
from symshrec.benchmark.planeless import Blob, Together
from symshrec.benchmark.scene import Scene
from symshrec.benchmark.surfaces import Moved, draw_shape
from symshrec.planes import Planes

SPHERE = Blob(np.eye(3)[:1], np.zeros(1), np.ones(1))
UPRIGHT = Planes([[1.0, 0, 0]], [[0.0, 0, 0]])


def on(surface, count=40_000, planes=UPRIGHT):
    chart = surface.draw(count, np.random.default_rng(9))
    return Scene(surface.points(chart), planes, surface, chart)


def shape_scene(family, points=6400, solid="cylinder"):
    config = BenchmarkConfig()
    config.surface.points = config.surface.citrus_points = points
    config.surface.cylinder_probability = float(solid == "cylinder")
    shape = draw_shape(family, np.random.default_rng(4), config)
    surface = Moved(shape.surface, np.diag([shape.unit_factor, shape.unit_factor, 1.0]), np.zeros(3))
    return Scene(surface.points(shape.chart), shape.planes, surface, shape.chart)


def perturbed(name, scene, seed=0, **scan):
    fresh = Scene(scene.points.copy(), scene.planes, scene.surface, scene.chart)
    return PERTURBATIONS[name](fresh, np.random.default_rng(seed), NoiseConfig(scan=ScanConfig(**scan)))


def place(parameters, name):
    return np.array([parameters[f"{name}_{axis}"] for axis in "xyz"])


def test_p10_has_the_ratio_asked_for_in_one_step_or_gradually():
    scene = on(SPHERE)
    for seed in range(3):
        points, parameters, _ = perturbed("P10", scene, seed, step_probability=1.0)
        assert len(points) == len(scene.points)
        direction = points.mean(axis=0) / np.linalg.norm(points.mean(axis=0))
        share, ratio = parameters["step_share"], parameters["density_ratio"]
        edge = np.quantile(scene.points @ direction, share)
        dense = (points @ direction > edge).mean()
        assert dense / (1 - dense) * share / (1 - share) == pytest.approx(ratio, rel=0.12)
        points, parameters, _ = perturbed("P10", scene, seed, step_probability=0.0)
        direction = points.mean(axis=0) / np.linalg.norm(points.mean(axis=0))
        counts, edges = np.histogram(points @ direction, 10, (-1, 1))  # of a sphere, even before
        slope = np.polyfit((edges[1:] + edges[:-1]) / 2, np.log(counts), 1)[0]
        assert np.exp(2 * slope) == pytest.approx(parameters["density_ratio"], rel=0.1)


def test_p10_and_p11_keep_points_where_they_can_and_put_others_on_the_surface():
    scene = shape_scene("astroid")
    dense = cKDTree(on(scene.surface, 200_000).points)
    for name in ("P10", "P11"):
        points, _, planes = perturbed(name, scene)
        kept = np.isin(points[:, 0], scene.points[:, 0])
        np.testing.assert_array_equal(points[kept], scene.points[kept])
        assert 0.05 < kept.mean() < 0.95
        assert dense.query(points[~kept])[0].max() < 0.08
        assert planes is scene.planes


def test_p11_is_as_dense_as_the_rays_of_a_scanner():
    scene = on(SPHERE)
    points, parameters, _ = perturbed("P11", scene)
    scanner = place(parameters, "scanner")
    distance = np.linalg.norm(scanner)
    assert distance == pytest.approx(1.3 * scene.diagonal, rel=0.01)
    counts, edges = np.histogram(points @ scanner / distance, 20, (-1, 1))
    height = (edges[1:] + edges[:-1]) / 2  # a sphere's normal is its point; squared distance by the law of cosines
    square = distance**2 + 1 - 2 * distance * height
    weights = np.abs(distance * height - 1) / square**1.5
    np.testing.assert_allclose(counts / counts.sum(), weights / weights.sum(), atol=0.006)


def test_p12_sees_what_is_in_front_and_nothing_behind_it():
    scene = on(SPHERE, 8000)
    for seed in range(3):
        points, parameters, _ = perturbed("P12", scene, seed)
        camera = place(parameters, "camera")
        horizon, towards = 1 / np.linalg.norm(camera), camera / np.linalg.norm(camera)
        visible = scene.points @ towards > horizon
        assert (points @ towards > horizon - 0.15).all()  # a little beyond: the method's own blur at this density
        assert (points @ towards > horizon).mean() > 0.93
        assert np.isin(scene.points[visible, 0], points[:, 0]).mean() > 0.95
        rows = np.flatnonzero(np.isin(scene.points[:, 0], points[:, 0]))
        np.testing.assert_array_equal(scene.points[rows], points)
    hidden = Moved(SPHERE, 0.3 * np.eye(3), -2 * camera / np.linalg.norm(camera))  # in the first one's shadow
    both = Together(SPHERE, hidden)
    chart = np.concatenate(
        [np.c_[s.draw(8000, np.random.default_rng(1)), np.full(8000, float(n))] for n, s in enumerate((SPHERE, hidden))]
    )
    scene = Scene(both.points(chart), UPRIGHT, both, chart)
    for seed in range(40):
        points, parameters, _ = perturbed("P12", scene, seed)
        view = place(parameters, "camera") - scene.centre
        if view @ camera > 0.97 * np.linalg.norm(view) * np.linalg.norm(camera):
            behind = np.linalg.norm(points - hidden.translation, axis=1) < 0.31
            assert behind.mean() < 0.01
            break
    else:
        pytest.fail("no camera looked along the two spheres")


def test_p13_removes_just_its_share_beyond_a_plane_or_out_of_one_side():
    scene = shape_scene("egg_keplero")
    bites = []
    for seed in range(30):
        points, parameters, _ = perturbed("P13", scene, seed)
        low, high = (0.01, 0.1) if parameters["bite"] else (0.05, 0.3)
        assert low <= parameters["removed_fraction"] <= high
        assert len(points) == 6400 - round(parameters["removed_fraction"] * 6400)
        kept = np.isin(scene.points[:, 0], points[:, 0])
        np.testing.assert_array_equal(scene.points[kept], points)
        bites.append(parameters["bite"])
        if parameters["bite"]:  # some plane has lost much more on one side than on the other
            sides = (scene.points[~kept] @ scene.planes.normals.T > 0).mean(axis=0)
            assert np.abs(sides - 0.5).max() > 0.4
    assert 6 < sum(bites) < 24


@pytest.mark.parametrize("solid", ["cylinder", "cone"])
@pytest.mark.parametrize("family", ["astroid", "geometric_petal", "egg_keplero"])
def test_p14_stands_on_a_floor_that_no_true_plane_mirrors(family, solid):
    scene = shape_scene(family, solid=solid)
    low, width = scene.points[:, 2].min(), np.ptp(scene.points[:, :2], axis=0).max()
    for seed in range(2):
        points, parameters, planes = perturbed("P14", scene, seed, floor_most=1e3)
        np.testing.assert_array_equal(points[:6400], scene.points)
        floor = points[6400:]
        assert (floor[:, 2] == low).all()
        assert len(floor) == parameters["floor_points"]
        side = parameters["floor_width"] * width
        middle = floor[:, :2].mean(axis=0) - scene.centre[:2]
        assert np.linalg.norm(middle) == pytest.approx(parameters["floor_offset"] * side, abs=0.03 * side)
        assert np.linalg.norm(floor[:, :2] - floor[:, :2].mean(axis=0), axis=1).max() < side / np.sqrt(2) * 1.05
        away = cKDTree(floor).query(planes.mirror(floor[::25]))[0].max(axis=1)
        assert (away > 0.02 * side).all()


def test_p14_is_as_dense_as_the_shape_and_no_larger_than_asked():
    scene = on(SPHERE, 6000)
    points, parameters, _ = perturbed("P14", scene, floor_most=1e3)
    area = (2 * parameters["floor_width"]) ** 2
    assert parameters["floor_points"] / area == pytest.approx(6000 / (4 * np.pi), rel=0.1)
    points, fewer, _ = perturbed("P14", scene, floor_most=2.0)
    assert len(points) == pytest.approx(12_000, abs=2)
    assert fewer["floor_points"] / 12_000 == pytest.approx(
        parameters["floor_points"] / (6000 + parameters["floor_points"]), abs=1e-3
    )


@pytest.mark.parametrize("solid", ["cylinder", "cone"])
@pytest.mark.parametrize("family", FAMILIES)
def test_p15_leaves_one_plane_exactly_and_no_other(family, solid):
    count = 1500
    scene = shape_scene(family, count, solid)
    images = scene.planes.mirror(scene.points)  # of the surface too, so that the cloud has every true plane exactly
    cloud = np.concatenate([scene.points, *images])
    bend = 0.04
    points, parameters, left = perturbed("P15", Scene(cloud, scene.planes, None, None), bend=[bend, bend])
    assert parameters == {"bend": bend}
    assert len(left) == 1
    (row,) = np.flatnonzero(np.abs(scene.planes.normals @ left.normals.T)[:, 0] > 1 - 1e-12)
    partner = points[count * (row + 1) : count * (row + 2)]
    np.testing.assert_allclose(left.mirror(points[:count])[0], partner, atol=1e-12)
    shift = np.linalg.norm(points - cloud, axis=1)
    diagonal = np.linalg.norm(np.ptp(cloud, axis=0))
    assert shift.max() == pytest.approx(bend * diagonal)
    assert (shift == 0).mean() > 0.3
    tree = cKDTree(points)
    for other in range(len(scene.planes)):
        if other != row:
            assert tree.query(scene.planes[[other]].mirror(points)[0])[0].max() > 0.15 * bend * diagonal
