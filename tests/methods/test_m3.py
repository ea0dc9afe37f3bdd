"""§3.3 M3: the planes of the straightforward implementation, on clouds good and bad, in any order and on any pool."""

import numpy as np
import pytest
import torch

from symshrec.benchmark.cloud import Labels
from symshrec.data.batch import Batch
from symshrec.methods.m3.module import M3
from symshrec.methods.m3.pipeline import detect_planes, spatial_order
from symshrec.methods.m3.settings import M3Settings
from symshrec.planes import Planes, axis_angles
from symshrec.speed.plain.m3 import detect_planes as reference_planes

SETTINGS = M3Settings(neighbours=40, time_factor=0.1)


def petal_cone(count=1200, petals=4, noise=0.0, seed=0):
    """A cone over ρ = 2 + cos(petals · u): mirror planes through the z axis every π/petals."""
    rng = np.random.default_rng(seed)
    u, s = rng.uniform(-np.pi, np.pi, count), np.sqrt(rng.uniform(0, 1, count))
    radius = (2 + np.cos(petals * u)) / 3
    points = np.stack([s * radius * np.cos(u), s * radius * np.sin(u), 1.3 * s], axis=1)
    return points + noise * rng.normal(size=points.shape)


def box_surface(count=900, seed=1):
    """The surface of a 1 × 2 × 3 box: three mirror planes."""
    rng = np.random.default_rng(seed)
    points = rng.uniform(-0.5, 0.5, (count, 3))
    axis = rng.integers(0, 3, count)
    points[np.arange(count), axis] = rng.choice([-0.5, 0.5], count)
    return points * [1, 2, 3] + [4, -1, 2]


def assert_same(planes: Planes, others: Planes, tolerance=1e-9):
    assert len(planes) == len(others)
    np.testing.assert_allclose(planes.confidences, others.confidences, atol=tolerance)
    assert np.diagonal(axis_angles(planes.normals, others.normals)).max(initial=0) < tolerance
    np.testing.assert_allclose(planes.points, others.points, atol=tolerance)


def in_reference_order(points):
    """The Laplacian depends on the order of its points, so that both must see the same."""
    centre, diagonal = (points.min(0) + points.max(0)) / 2, np.linalg.norm(np.ptp(points, axis=0))
    return spatial_order((points - centre) / diagonal) * diagonal + centre


def batch_of(clouds, names=None):
    count = len(clouds)
    return Batch(
        points=torch.cat([torch.as_tensor(cloud, dtype=torch.float32) for cloud in clouds]),
        lengths=torch.tensor([len(cloud) for cloud in clouds]),
        truth=[None] * count,
        labels=[Labels()] * count,
        positions=list(range(count)),
        ids=list(range(count)),
        names=names or [f"cloud-{i}" for i in range(count)],
        diagonals=torch.ones(count, dtype=torch.float64),
    )


@pytest.mark.parametrize(
    ("points", "neighbours", "limit", "time_factor"),
    [
        (petal_cone(), 40, 100.0, 1.0),
        (petal_cone(petals=3, noise=0.02), 25, 100.0, 0.1),
        (petal_cone(800, petals=5, seed=2), 20, 6.0, 0.03),
        (box_surface(), 30, 100.0, 3.0),
        (np.random.default_rng(3).normal(size=(500, 3)), 12, 15.0, 0.3),
    ],
    ids=["cone", "noisy cone", "many maxima, low limit", "box", "blob"],
)
def test_planes_of_the_straightforward_implementation(points, neighbours, limit, time_factor):
    settings = M3Settings(neighbours=neighbours, chamfer_limit=limit, time_factor=time_factor)
    reference = reference_planes(in_reference_order(points), neighbours, chamfer_limit=limit, time_factor=time_factor)
    assert len(reference) > 1
    assert_same(detect_planes(points, settings), reference)


def test_finds_the_planes_of_a_clean_cone():
    planes = detect_planes(petal_cone(1500), M3Settings(neighbours=50, time_factor=0.1))
    angles = np.arange(4) * np.pi / 4
    true_normals = np.stack([-np.sin(angles), np.cos(angles), 0 * angles], axis=1)
    errors = np.rad2deg(axis_angles(planes.normals[:1], true_normals)).min()
    assert errors < 3
    assert abs(planes.offsets[0]) < 0.03


def test_output_is_sorted_separated_and_in_range():
    planes = detect_planes(petal_cone(noise=0.01), M3Settings(neighbours=15))
    assert len(planes) > 5
    assert (np.diff(planes.confidences) <= 0).all()
    assert ((planes.confidences > 0) & (planes.confidences <= 1)).all()
    angles = np.rad2deg(axis_angles(planes.normals, planes.normals))[np.triu_indices(len(planes), 1)]
    assert angles.min() > 5


def test_chamfer_limit_scales_confidence_and_cuts():
    points = petal_cone(noise=0.01)
    wide, narrow = (detect_planes(points, M3Settings(neighbours=20, chamfer_limit=limit)) for limit in (100.0, 4.0))
    distances = 100 * (1 - wide.confidences)
    assert 0 < len(narrow) < len(wide)
    np.testing.assert_allclose(4 * (1 - narrow.confidences), distances[distances < 4], atol=1e-9)


def test_same_planes_every_time_and_in_any_order():
    points = petal_cone(noise=0.01)
    planes = detect_planes(points, SETTINGS)
    shuffled = detect_planes(np.random.default_rng(5).permutation(points), SETTINGS)
    for other in (detect_planes(points, SETTINGS), shuffled):
        np.testing.assert_array_equal(planes.normals, other.normals)
        np.testing.assert_array_equal(planes.confidences, other.confidences)


def test_scale_and_translation_move_the_planes_along():
    points = petal_cone(noise=0.01)
    moved = detect_planes(8 * points + [64, -32, 16], SETTINGS)
    assert_same(moved, detect_planes(points, SETTINGS).transformed(scale=8, translation=[64, -32, 16]), 1e-6)


def test_planes_turn_with_a_clean_cloud():
    """Not to rounding: a turned cloud has another Laplacian by some .1 %, hence other sample points as maxima."""
    points = box_surface(1500)
    rotation = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0]
    settings = M3Settings(neighbours=50, time_factor=0.1)
    turned = detect_planes(points @ rotation.T, settings)[:1]
    expected = detect_planes(points, settings).transformed(rotation)
    assert np.rad2deg(axis_angles(turned.normals, expected.normals)).min() < 3


def test_coincident_points_count_once():
    points = petal_cone(600)
    assert_same(detect_planes(np.repeat(points, 3, axis=0), SETTINGS), detect_planes(points, SETTINGS))


RNG = np.random.default_rng(0)
LINE = np.linspace(0, 1, 300)[:, None]


@pytest.mark.parametrize(
    "points",
    [
        pytest.param(np.zeros((0, 3)), id="empty"),
        pytest.param(np.ones((1, 3)), id="single"),
        pytest.param(np.ones((400, 3)), id="coincident"),
        pytest.param(RNG.random((3, 3)), id="three"),
        pytest.param(RNG.random((10, 3))[RNG.integers(0, 10, 400)], id="ten-repeated"),
        pytest.param(RNG.random((4, 3)), id="four"),
        pytest.param(RNG.random((11, 3)), id="eleven"),
        pytest.param(RNG.random((30, 3)), id="thirty"),
        pytest.param(RNG.random((49, 3)), id="forty-nine"),
        pytest.param(LINE * [1, 2, 3], id="oblique-line"),
        pytest.param(LINE * [1, 0, 0] + [5, 5, 5], id="line"),
        pytest.param(np.concatenate([LINE * [1, 0, 0], LINE * [1, 0, 0] + [0, 1, 0]]), id="two-lines"),
        pytest.param(LINE * [1, 0, 0] + 1e-7 * RNG.random((300, 3)), id="near-line"),
        pytest.param(RNG.random((300, 3)) * [1, 1, 0], id="coplanar"),
        pytest.param(np.stack(np.meshgrid(*[np.arange(7.0)] * 3), axis=-1).reshape(-1, 3), id="grid"),
        pytest.param(np.concatenate([1e-3 * RNG.random((200, 3)), 1e-3 * RNG.random((200, 3)) + 1]), id="two-blobs"),
        pytest.param(np.concatenate([1e-6 * RNG.random((200, 3)), np.ones((1, 3))]), id="outlier"),
        pytest.param(1e-200 * RNG.random((100, 3)), id="tiny-scale"),
        pytest.param(RNG.random((100, 3)).astype(np.float32) + 1e7, id="far-away"),
        pytest.param(RNG.integers(0, 4, (300, 3)), id="integers"),
    ],
)
def test_degenerate_clouds_give_planes_or_none(points):
    planes = detect_planes(points, M3Settings(neighbours=10))
    assert ((planes.confidences > 0) & (planes.confidences <= 1)).all()


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (np.zeros((5, 2)), r"shape \(5, 2\), expected \(N, 3\)"),
        (np.zeros(3), r"shape \(3,\)"),
        (np.array([[0, 0, 0], [1, np.nan, 0]]), "point 1 is not finite"),
        (np.array([[np.inf, 0, 0]]), "point 0 is not finite"),
    ],
)
def test_unusable_points_are_named(points, message):
    with pytest.raises(ValueError, match=message):
        detect_planes(points)


@pytest.mark.parametrize(
    "setting",
    [{"neighbours": 0}, {"eigenpairs": 1}, {"time_factor": 0.0}, {"chamfer_limit": float("nan")}, {"workers": -1}],
)
def test_settings_out_of_range_are_named(setting):
    with pytest.raises(ValueError, match=next(iter(setting))):
        M3Settings(**setting)


@pytest.fixture
def pooled():
    method = M3(M3Settings(neighbours=40, workers=2))
    yield method
    method.teardown("test")


def test_pool_gives_the_serial_planes_and_names_a_failing_cloud(pooled):
    clouds = [petal_cone(500, seed=seed) for seed in range(5)] + [np.ones((1, 3))]
    serial = M3(M3Settings(neighbours=40)).detect_batch(batch_of(clouds))
    for planes, expected in zip(pooled.detect_batch(batch_of(clouds)), serial, strict=True):
        np.testing.assert_array_equal(planes.normals, expected.normals)
        np.testing.assert_array_equal(planes.confidences, expected.confidences)
    with pytest.raises(ValueError, match="cloud bad: point 0 is not finite"):
        pooled.detect_batch(batch_of([clouds[0], np.full((5, 3), np.nan), clouds[1]], ["good", "bad", "fine"]))


def test_a_killed_worker_is_an_error_and_the_next_batch_works(pooled):
    batch = batch_of([petal_cone(500)], ["victim"])
    expected = pooled.detect_batch(batch)[0]
    for process in list(pooled.pool._executor._processes.values()):
        process.kill()
        process.join()
    with pytest.raises(RuntimeError, match=r"worker process died.*victim"):
        pooled.detect_batch(batch)
    np.testing.assert_array_equal(pooled.detect_batch(batch)[0].normals, expected.normals)


def test_serial_failure_names_the_cloud():
    with pytest.raises(ValueError, match="cloud bad: point 0 is not finite"):
        M3().detect_batch(batch_of([np.full((5, 3), np.nan)], ["bad"]))


def test_detect_takes_a_tensor_of_any_precision():
    points = petal_cone(600).astype(np.float32)
    planes = M3(M3Settings(neighbours=40)).detect(torch.from_numpy(points))
    assert_same(planes, detect_planes(points, M3Settings(neighbours=40)))


@pytest.mark.parametrize("workers", [1, 2])
def test_runs_that_share_the_diffusion_function_find_what_they_find_alone(workers, monkeypatch):
    batch = batch_of([petal_cone(), box_surface(), np.zeros((3, 3))])
    settings = [M3Settings(neighbours=count, time_factor=0.1, workers=workers) for count in (40, 60)]
    alone = [M3(each).detect_batch(batch) for each in settings]
    shelf, found = {}, []
    for each in settings:
        method = M3(each)
        method.shelf = shelf
        found.append(method.detect_batch(batch))
        method.pool.close()
        monkeypatch.setattr("symshrec.methods.m3.module.diffused", lambda *_: pytest.fail("computed twice"))
    for mine, others in zip(found, alone, strict=True):
        for planes, expected in zip(mine, others, strict=True):
            np.testing.assert_array_equal(planes.normals, expected.normals)
            np.testing.assert_array_equal(planes.confidences, expected.confidences)
    assert len(found[0][0]) > len(found[0][2]) == 0
    other = M3(M3Settings(time_factor=0.2))
    other.shelf = shelf
    with pytest.raises(BaseException, match="computed twice"):
        other.detect_batch(batch)
