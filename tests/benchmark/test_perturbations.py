"""P0–P5: what moves, by how much, what goes, and that strength zero is the identity."""

import numpy as np
import pytest

from symshrec.benchmark.config import DrawnPer, NoiseConfig, NoiseShift
from symshrec.benchmark.perturbations import PERTURBATIONS

POINTS = np.random.default_rng(5).normal(size=(5000, 3))


def perturbed(name, config=None, seed=0):
    return PERTURBATIONS[name](POINTS.copy(), np.random.default_rng(seed), config or NoiseConfig())


@pytest.mark.parametrize("name", PERTURBATIONS)
def test_strength_zero_is_the_identity(name):
    points, _ = perturbed(name, NoiseConfig(fraction=[0.0, 0.0], removed_fraction=[0.0, 0.0]))
    np.testing.assert_array_equal(points, POINTS)


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
    expected, first = PERTURBATIONS[noise](POINTS.copy(), rng, NoiseConfig())
    expected, second = PERTURBATIONS["P3"](expected, rng, NoiseConfig())
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
