"""The calibration of M4's confidences: candidates of training shapes with their truth, and a regression on them."""

import numpy as np
import pytest

from symshrec.runs.calibration import fitted, labelled_candidates, labelled_surface_candidates
from symshrec.runs.config import benchmark_of, load


def test_candidates_of_clean_clouds_are_mostly_true():
    benchmark = benchmark_of(load(["data=smoke", "data.benchmark.surface.points=1600"]))
    tables, labels = zip(*labelled_candidates(benchmark, 7, ["P0"]), strict=True)
    table, truth = np.concatenate(tables), np.concatenate(labels)
    assert table.shape == (len(truth), 3)
    assert truth.mean() > 0.8
    assert np.median(table[truth, 0]) < 0.03
    assert np.isfinite(table).all()


def test_the_fit_finds_the_weights_that_made_the_labels():
    rng = np.random.default_rng(0)
    table = rng.uniform(0, 1, (20_000, 3)) * [0.2, 0.1, 0.05]
    chance = 1 / (1 + np.exp(-(3 - 40 * table[:, 0] - 20 * table[:, 1] + 60 * table[:, 2])))
    assert fitted(table, rng.uniform(size=len(table)) < chance) == pytest.approx([3, -40, -20, 60], rel=0.15)


def test_surface_is_not_asked_of_clouds_that_density_settles():
    benchmark = benchmark_of(load(["data=smoke", "data.benchmark.surface.points=1600"]))
    tables, labels = zip(*labelled_surface_candidates(benchmark, 8, 2, ["P0", "P13"], 0.25), strict=True)
    asked = [len(each) > 0 for each in labels]
    assert set(asked) == {True, False}
    table, truth = np.concatenate(tables), np.concatenate(labels)
    assert table.shape == (len(truth), 13)
    assert np.isfinite(table).all()
    assert table[truth, 1].mean() < table[~truth, 1].mean()  # true planes leave less surface without a mirror image
