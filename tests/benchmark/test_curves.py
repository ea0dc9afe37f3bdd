"""Table 1's curves against their implicit equations, their mirror lines, and the three ways of drawing u."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from symshrec.benchmark.config import CitrusForm, CurveSampling, CurvesConfig, PetalFrequency
from symshrec.benchmark.curves import CURVES, draw_curve

DENSE = 20_000
SEEDS = range(4)


def dense_points(curve):
    low, high = curve.domain
    return curve.points(low + (high - low) * np.arange(DENSE) / DENSE)


def residual(family, x, y, a, b=0.0, m=0.0):
    """The family's implicit equation, zero on the curve: from an atlas, not from the parametrisation."""
    r, angle = np.hypot(x, y), np.arctan2(y, x)
    shifted = x + a / 2
    petal = a + b * np.cos(2 * m * angle)
    return {
        "astroid": lambda: np.cbrt(x**2) + np.cbrt(y**2) - np.cbrt(a**2),
        "citrus": lambda: a**4 * y**2 - b**2 * ((a - shifted) * shifted) ** 3,
        "m_convexities": lambda: r * (1 + b * np.cos(m * angle)) - a,
        "geometric_petal": lambda: np.minimum(np.abs(r - petal), np.abs(r + petal)),
        "lemniscate_bernoulli": lambda: r**4 - a**2 * (x**2 - y**2),
        "egg_keplero": lambda: (shifted**2 + y**2) ** 2 - a * shifted**3,
        "mouth_curve": lambda: a**4 * y**2 - (a**2 - x**2) ** 3,
    }[family]()


@pytest.mark.parametrize("family", CURVES)
def test_points_fulfil_the_implicit_equation_and_close_up(family):
    for seed in SEEDS:
        curve = draw_curve(family, np.random.default_rng(seed), CurvesConfig())
        points = dense_points(curve)
        assert np.abs(residual(family, *points.T, **curve.parameters)).max() < 1e-9
        assert points[:, 1].max() == pytest.approx(-points[:, 1].min(), abs=1e-2)


@pytest.mark.parametrize("family", CURVES)
def test_mirror_lines_are_all_the_lines_there_are(family):
    for seed in SEEDS:
        curve = draw_curve(family, np.random.default_rng(seed), CurvesConfig())
        points = dense_points(curve)
        tree, size = cKDTree(points), np.abs(points).max()
        spacing = np.pi / len(curve.mirror_angles)
        for angle in curve.mirror_angles:
            for offset, is_line in ((0.0, True), (spacing / 2, False)):
                direction = np.array([np.cos(angle + offset), np.sin(angle + offset)])
                mirrored = 2 * (points @ direction)[:, None] * direction - points
                far = tree.query(mirrored[:: DENSE // 500])[0].max()
                assert (far < 3e-3 * size) if is_line else (far > 3e-2 * size)


def test_number_of_lines_follows_the_parameters():
    config = CurvesConfig(petal_m=[6, 6], convexities_m=[9, 9])
    rng = np.random.default_rng(0)
    counts = {family: len(draw_curve(family, rng, config).mirror_angles) for family in CURVES}
    assert counts == {
        "astroid": 4,
        "citrus": 2,
        "m_convexities": 9,
        "geometric_petal": 12,
        "lemniscate_bernoulli": 2,
        "egg_keplero": 1,
        "mouth_curve": 2,
    }
    config.petal_frequency = PetalFrequency.m
    assert len(draw_curve("geometric_petal", rng, config).mirror_angles) == 6


def test_parameters_reach_both_ends_of_their_ranges():
    rng = np.random.default_rng(0)
    drawn = [draw_curve(family, rng, CurvesConfig()).parameters for family in CURVES for _ in range(300)]
    assert {each["b"] for each in drawn[300:600]} == set(range(1, 14))
    assert {each["m"] for each in drawn[600:900]} == set(range(3, 10))
    assert {(each["b"], each["m"]) for each in drawn[900:1200]} == {(b, m) for b in range(1, 7) for m in range(1, 7)}
    for rows, name, low, high in ((slice(600, 900), "a", 0.5, 1.1), (slice(600, 900), "b", 0.2, 0.9)):
        values = [each[name] for each in drawn[rows]]
        assert low <= min(values) < low + 0.05
        assert high - 0.05 < max(values) <= high


def test_citrus_forms_differ_by_b_squared():
    forms = []
    for form in CitrusForm:
        curve = draw_curve("citrus", np.random.default_rng(3), CurvesConfig(citrus_form=form))
        forms.append(curve.points(np.linspace(0, 1, 9)))
    b = curve.parameters["b"]
    assert b > 1
    np.testing.assert_allclose(forms[0], forms[1] * [1, b * b], atol=1e-12)


@pytest.mark.parametrize("sampling", CurveSampling)
def test_sampling_is_uniform_in_what_it_says(sampling):
    curve = draw_curve("egg_keplero", np.random.default_rng(0), CurvesConfig())
    x, y = curve.sample(4000, np.random.default_rng(1), sampling).T
    u = y / (x + 0.5)
    if sampling is CurveSampling.grid:
        np.testing.assert_allclose(u, -4 + 8 * np.arange(4000) / 4000, atol=1e-9)
        return
    grid = np.linspace(-4, 4, 100_001)
    speed = np.ones_like(grid)
    if sampling is CurveSampling.arc_length:
        speed = np.hypot(-4 * grid / (1 + grid**2) ** 3, (1 - 3 * grid**2) / (1 + grid**2) ** 3)
    passed = np.concatenate([[0], np.cumsum((speed[1:] + speed[:-1]) / 2)])
    shares = np.sort(np.interp(u, grid, passed / passed[-1]))
    kolmogorov = np.abs(shares - (np.arange(4000) + 0.5) / 4000).max() * np.sqrt(4000)
    assert kolmogorov < 1.95


def test_unknown_family_names_the_known_ones():
    with pytest.raises(ValueError, match=r"'circle'.*astroid"):
        draw_curve("circle", np.random.default_rng(0), CurvesConfig())
