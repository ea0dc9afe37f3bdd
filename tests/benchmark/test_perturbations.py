"""P0–P9: what moves, by how much, what goes, what comes, and that strength zero is the identity for all of them."""

import numpy as np
import pytest

from symshrec.benchmark.config import BenchmarkConfig, DrawnPer, HardConfig, NoiseConfig, NoiseShift, ScanConfig
from symshrec.benchmark.perturbations import PERTURBATIONS
from symshrec.benchmark.scene import Scene
from symshrec.benchmark.surfaces import draw_shape
from symshrec.planes import Planes

POINTS = np.random.default_rng(5).normal(size=(5000, 3))
NONE = [0.0, 0.0]


def perturbed(name, config=None, seed=0, points=POINTS):
    rng = np.random.default_rng(seed) if isinstance(seed, int) else seed
    scene = Scene(points.copy(), Planes.empty(), None, None)
    return PERTURBATIONS[name](scene, rng, config or NoiseConfig())[:2]


@pytest.mark.parametrize("name", sorted(PERTURBATIONS.keys() - {"P11", "P12"}))  # a view has no strength
def test_strength_zero_is_the_identity(name):
    shape = draw_shape("astroid", np.random.default_rng(1), BenchmarkConfig())
    clean = shape.surface.points(shape.chart)
    hard = HardConfig(cut_fraction=NONE, outlier_fraction=NONE, few_points=[len(clean)] * 2)
    scan = ScanConfig([1.0, 1.0], cut_fraction=NONE, bite_fraction=NONE, floor_width=NONE, bend=NONE)
    config = NoiseConfig(fraction=NONE, removed_fraction=NONE, hard=hard, scan=scan)
    scene = Scene(clean.copy(), shape.planes, shape.surface, shape.chart)
    points, _, planes = PERTURBATIONS[name](scene, np.random.default_rng(0), config)
    np.testing.assert_array_equal(points, clean)
    assert planes is shape.planes


def test_p0_changes_nothing():
    points, parameters = perturbed("P0")
    np.testing.assert_array_equal(points, POINTS)
    assert parameters == {}


@pytest.mark.parametrize("name", ["P1", "P2"])
def test_noise_moves_the_drawn_share_by_the_drawn_n(name):
    config = NoiseConfig()
    seen = set()
    for seed in range(30):
        points, parameters = perturbed(name, config, seed)
        moved = (points != POINTS).any(axis=1)
        assert moved.sum() == round(parameters["noise_fraction"] * 5000)
        assert 0.3 <= parameters["noise_fraction"] <= 0.8
        shifts, n = (points - POINTS)[moved] * parameters["noise_n"], parameters["noise_n"]
        seen.add(n)
        if name == "P1":
            assert np.abs(shifts).max() <= 1 + 1e-9
        np.testing.assert_allclose(shifts.std(axis=0), 1 / np.sqrt(3) if name == "P1" else 1, rtol=0.08)
        assert np.abs(np.corrcoef(shifts.T)[np.triu_indices(3, 1)]).max() < 0.15
    assert seen == set(config.uniform_n if name == "P1" else config.gaussian_n)


def test_noise_is_to_the_bit_that_of_these_draws_added_to_rows():
    config = NoiseConfig()
    for seed in range(5):
        rng, plain = np.random.default_rng(seed), POINTS.copy()
        share = rng.uniform(*config.fraction)
        rows = rng.permutation(len(plain))[: round(share * len(plain))]
        n = rng.choice(config.uniform_n)
        plain[rows] += rng.uniform(-1.0, 1.0, (len(rows), 3)) * np.power(n, -1.0)
        np.testing.assert_array_equal(perturbed("P1", config, seed)[0], plain)
        kept = np.ones(len(plain), dtype=bool)
        removed = round(rng.uniform(*config.removed_fraction) * len(plain))
        kept[rng.permutation(len(plain))[:removed]] = False
        np.testing.assert_array_equal(perturbed("P4", config, seed)[0], plain[kept])


def test_undersampling_keeps_order_and_the_drawn_share():
    shares = []
    for seed in range(30):
        points, parameters = perturbed("P3", seed=seed)
        assert len(points) == 5000 - round(parameters["removed_fraction"] * 5000)
        rows = np.flatnonzero(np.isin(POINTS[:, 0], points[:, 0]))
        np.testing.assert_array_equal(POINTS[rows], points)
        shares.append(parameters["removed_fraction"])
    assert 0.3 <= min(shares) < 0.4
    assert 0.7 < max(shares) <= 0.8
    kept, _ = perturbed("P3", NoiseConfig(removed_fraction=[1.0, 1.0]))
    assert len(kept) == 1


@pytest.mark.parametrize(("combined", "noise"), [("P4", "P1"), ("P5", "P2")])
def test_combined_perturbations_are_noise_then_undersampling(combined, noise):
    rng = np.random.default_rng(7)
    expected, first = perturbed(noise, seed=rng)
    expected, second = perturbed("P3", seed=rng, points=expected)
    points, parameters = perturbed(combined, seed=7)
    np.testing.assert_array_equal(points, expected)
    assert parameters == first | second


def test_silent_choices_of_the_noise_are_values():
    points, parameters = perturbed("P2", NoiseConfig(fraction=[1.0, 1.0], gaussian_power=2.0))
    np.testing.assert_allclose((points - POINTS).std(axis=0) * parameters["noise_n"] ** 2, 1, rtol=0.05)
    points, _ = perturbed("P1", NoiseConfig(shift=NoiseShift.scalar))
    shifts = points - POINTS
    np.testing.assert_allclose(shifts, np.repeat(shifts[:, :1], 3, axis=1), atol=1e-12)
    points, parameters = perturbed("P1", NoiseConfig(fraction=[1.0, 1.0], uniform_n=[1, 10], n_per=DrawnPer.point))
    assert "noise_n" not in parameters
    small = (np.abs(points - POINTS) < 0.1).all(axis=1).mean()
    assert small == pytest.approx(0.5 + 0.5 * 0.1**3, abs=0.03)


def rows_in_points(points):
    """Places of `points` in POINTS, which has no point twice."""
    return np.flatnonzero(np.isin(POINTS[:, 0], points[:, 0]))


def test_p6_cuts_one_side_away_by_a_plane_or_a_ball():
    holes = []
    for seed in range(40):
        points, parameters = perturbed("P6", seed=seed, points=POINTS[:800])
        removed = np.delete(POINTS[:800], rows_in_points(points), axis=0)
        assert 0.1 <= parameters["removed_fraction"] <= 0.4
        assert len(removed) == round(parameters["removed_fraction"] * 800)
        np.testing.assert_array_equal(POINTS[rows_in_points(points)], points)
        holes.append(parameters["hole"])
        if parameters["hole"]:  # one of the points removed is nearer to all others removed than to any point left
            reach = np.linalg.norm(removed[:, None] - removed, axis=2).max(axis=1)
            assert (np.linalg.norm(removed[:, None] - points, axis=2).min(axis=1) >= reach).any()
        else:  # a plane across the line of the two means separates them, but for the sampling of that line
            normal = removed.mean(axis=0) - points.mean(axis=0)
            assert np.median(removed @ normal) > np.quantile(points @ normal, 0.95)
    assert 8 < sum(holes) < 32
    assert len(perturbed("P6", NoiseConfig(hard=HardConfig(cut_fraction=[1.0, 1.0])))[0]) == 1


def test_p7_is_p1_or_p2_with_a_smaller_n():
    seen = set()
    for seed in range(60):
        points, parameters = perturbed("P7", seed=seed)
        moved = (points != POINTS).any(axis=1)
        assert moved.sum() == round(parameters["noise_fraction"] * 5000)
        shifts = (points - POINTS)[moved] * parameters["noise_n"]
        np.testing.assert_allclose(shifts.std(axis=0), 1 if parameters["gaussian"] else 1 / np.sqrt(3), rtol=0.08)
        assert (np.abs(shifts).max() > 1 + 1e-9) == parameters["gaussian"]
        seen.add((parameters["gaussian"], parameters["noise_n"]))
    assert {n for _, n in seen} == {4, 5, 6, 7, 8, 9, 10}
    assert {gaussian for gaussian, _ in seen} == {0, 1}


def test_p8_adds_points_in_the_bounding_box_among_the_true_ones():
    shares = []
    for seed in range(30):
        points, parameters = perturbed("P8", seed=seed)
        true = np.isin(points[:, 0], POINTS[:, 0])
        np.testing.assert_array_equal(points[true], POINTS)
        added = points[~true]
        assert len(added) == round(parameters["outlier_fraction"] * 5000)
        low, high = POINTS.min(axis=0), POINTS.max(axis=0)
        np.testing.assert_array_equal([points.min(axis=0), points.max(axis=0)], [low, high])
        np.testing.assert_allclose(((added - low) / (high - low)).mean(axis=0), 0.5, atol=0.1)
        assert np.flatnonzero(~true).mean() == pytest.approx(len(points) / 2, rel=0.15)
        shares.append(parameters["outlier_fraction"])
    assert 0.05 <= min(shares) < 0.1
    assert 0.25 < max(shares) <= 0.3


def test_p9_leaves_a_few_points_in_order():
    counts = []
    for seed in range(30):
        points, parameters = perturbed("P9", seed=seed)
        np.testing.assert_array_equal(POINTS[rows_in_points(points)], points)
        assert len(points) == parameters["points_left"]
        counts.append(len(points))
    assert 256 <= min(counts) < 350
    assert 930 < max(counts) <= 1024
    few = np.random.default_rng(0).normal(size=(100, 3))
    np.testing.assert_array_equal(perturbed("P9", seed=1, points=few)[0], few)
