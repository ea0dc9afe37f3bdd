"""Which clouds a split holds: exact counts, spread evenly, and configs that cannot be are refused by name."""

from collections import Counter
from itertools import product

import numpy as np
import pytest

from symshrec.benchmark.balance import split_labels
from symshrec.benchmark.cloud import FAMILIES, PERTURBATIONS, PUBLISHED_PERTURBATIONS
from symshrec.benchmark.config import (
    BenchmarkConfig,
    HardConfig,
    NoiseConfig,
    PlanelessConfig,
    ScanConfig,
    SplitConfig,
    SurfaceConfig,
)
from symshrec.benchmark.generate import generate_dataset

TEST_FAMILIES = dict(zip(FAMILIES, (1319, 1302, 1203, 1344, 1289, 1275, 1268), strict=True))


def test_paper_scale_has_the_published_counts():
    splits = {
        "train": SplitConfig(60_000),
        "test": SplitConfig(9_000, dict.fromkeys(PUBLISHED_PERTURBATIONS, 1500), TEST_FAMILIES),
    }
    config = BenchmarkConfig(splits=splits)
    train, test = split_labels(config, "train"), split_labels(config, "test")
    assert np.bincount(train.perturbations).tolist() == [10_000] * 6
    assert np.bincount(train.families).tolist() == [8572] * 3 + [8571] * 4
    assert np.bincount(test.perturbations).tolist() == [1500] * 6
    assert np.bincount(test.families).tolist() == list(TEST_FAMILIES.values())
    for labels in (train, test):
        pairs = np.bincount(labels.families * 6 + labels.perturbations, minlength=42).reshape(7, 6)
        assert np.ptp(pairs, axis=1).max() <= 1
        assert abs(np.corrcoef(labels.families[:-1], labels.families[1:])[0, 1]) < 0.05


def test_smoke_scale_has_every_pair_once():
    labels = split_labels(BenchmarkConfig(splits={"train": SplitConfig(42)}), "train")
    pairs = Counter(zip(labels.families.tolist(), labels.perturbations.tolist(), strict=True))
    assert pairs == dict.fromkeys(product(range(7), range(6)), 1)


def test_uneven_counts_hold_exactly_and_spread():
    perturbations, families = {"P0": 300, "P8": 100, "P3": 7}, {"citrus": 400, "astroid": 7}
    labels = split_labels(BenchmarkConfig(splits={"x": SplitConfig(407, perturbations, families)}), "x")
    assert Counter(np.array(PERTURBATIONS)[labels.perturbations].tolist()) == perturbations
    assert Counter(np.array(FAMILIES)[labels.families].tolist()) == families
    assert (labels.perturbations[labels.families == 0] == 0).sum() in (4, 5, 6)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"splits": {"train": SplitConfig(5, {"P0": 4})}}, r"splits\.train\.perturbations.*add up.*5"),
        ({"splits": {"train": SplitConfig(5, {"P16": 5})}}, r"P16; there are P0, .*, P15"),
        ({"splits": {"train": SplitConfig(5, None, {"astroid": 6, "citrus": -1})}}, r"splits\.train\.families"),
        ({"splits": {"train": SplitConfig(0)}}, r"splits\.train\.clouds is 0"),
        ({"splits": {}}, r"splits is empty"),
        ({"splits": {"../train": SplitConfig(5)}}, r"'\.\./train'"),
        ({"noise": NoiseConfig(fraction=[0.8, 0.3])}, r"noise\.fraction.*low ≤ high"),
        ({"noise": NoiseConfig(gaussian_n=[])}, r"noise\.gaussian_n"),
        ({"noise": NoiseConfig(hard=HardConfig(strong_n=[0]))}, r"noise\.hard\.strong_n is \[0\]"),
        ({"noise": NoiseConfig(hard=HardConfig(few_points=[0, 9]))}, r"noise\.hard\.few_points is \[0, 9\]"),
        ({"noise": NoiseConfig(scan=ScanConfig(density_ratio=[0.5, 2]))}, r"noise\.scan\.density_ratio is \[0.5, 2\]"),
        ({"noise": NoiseConfig(scan=ScanConfig(distance=0.5))}, r"noise\.scan\.distance is 0.5"),
        ({"planeless": PlanelessConfig(bumps=[1, 2])}, r"planeless\.bumps is \[1, 2\]"),
        ({"surface": SurfaceConfig(cylinder_probability=1.2)}, r"surface\.cylinder_probability is 1.2"),
        ({"surface": SurfaceConfig(height=[float("nan"), 4.0])}, r"surface\.height"),
        ({"clouds_per_shard": 0}, r"clouds_per_shard is 0"),
    ],
)
def test_impossible_configs_are_refused_by_name_before_anything_is_written(change, message, tmp_path):
    config = BenchmarkConfig(**({"splits": {"train": SplitConfig(5)}} | change))
    with pytest.raises(ValueError, match=message):
        generate_dataset(config, tmp_path / "out", workers=1, progress=False)
    assert not (tmp_path / "out").exists()
