"""Confidence against the share of right planes, and runs beside their truth."""

from dataclasses import replace

import numpy as np
import pytest

from symshrec.benchmark.cloud import Labels
from symshrec.benchmark.shards import ShardedSplit
from symshrec.files.predictions import save_predictions
from symshrec.planes import PackedPlanes, Planes
from symshrec.reporting.figures.figures import make_result_figures, reliability_figure
from symshrec.reporting.figures.reliability import reliability
from symshrec.reporting.tables.compared import Compared, compare_runs


def a_run(confidences, right):
    """One cloud for every confidence, with one plane found there, right or wrong."""
    true = Planes([[1, 0, 0]], [[0, 0, 0]])
    found = [
        Planes([[1, 0, 0] if ok else [0, 1, 0]], [[0, 0, 0]], [confidence])
        for confidence, ok in zip(confidences, right, strict=True)
    ]
    clouds = len(found)
    packed = PackedPlanes.pack(found), PackedPlanes.pack([true] * clouds)
    return Compared("M4", *packed, np.ones(clouds), [Labels()] * clouds)


def test_bins_hold_share_mean_and_number():
    run = a_run([0.0, 0.04, 0.5, 0.55, 0.59, 0.999, 1.0], [0, 0, 1, 0, 1, 1, 1])
    found = reliability(run)
    assert found.counts.tolist() == [2, 0, 0, 0, 0, 3, 0, 0, 0, 2]
    filled = found.counts > 0
    np.testing.assert_allclose(found.correct[filled], [0, 2 / 3, 1])
    np.testing.assert_allclose(found.confidences[filled], [0.02, 1.64 / 3, 0.9995])
    assert np.isnan(found.correct[~filled]).all()
    assert found.error == pytest.approx((2 * 0.02 + 3 * (2 / 3 - 1.64 / 3) + 2 * 0.0005) / 7)


def test_calibrated_confidences_have_no_gap_and_a_plane_found_twice_is_wrong():
    rng = np.random.default_rng(0)
    confidences = rng.random(4000)
    run = a_run(confidences, rng.random(4000) < confidences)
    assert reliability(run).error < 0.03
    twice = Planes([[1, 0, 0]] * 2, np.zeros((2, 3)), [0.9, 0.8])
    twice = replace(run, predicted=PackedPlanes.pack([twice] * 4000))
    assert reliability(twice).correct[[8, 9]].tolist() == [0, 1]
    assert reliability(replace(run, predicted=PackedPlanes.pack([Planes.empty()] * 4000))).error == 0


def test_a_confidence_beyond_one_is_refused():
    with pytest.raises(ValueError, match=r"M4 has a confidence of 1\.5, outside"):
        reliability(a_run([0.5, 1.5], [1, 1]))


def test_the_figure_shows_share_and_counts(tmp_path):
    run = a_run([0.05, 0.95, 0.97], [0, 1, 1])
    above, below = reliability_figure([reliability(run)]).axes
    np.testing.assert_allclose(above.lines[1].get_xydata(), [[0.05, 0], [0.96, 1]])
    assert below.patches[0].get_data().values.sum() == 3
    assert [path.name for path in make_result_figures([], tmp_path, [run])] == ["reliability.png"]


def test_runs_stand_beside_the_truth_of_their_clouds(smoke_root, tmp_path):
    split = ShardedSplit(smoke_root, "test")
    positions = [3, 8, 20]
    planes = PackedPlanes.pack([split[position].planes for position in positions])
    paths = {name: tmp_path / f"{name}.safetensors" for name in ("one", "two", "other", "fewer")}
    about = {"method": "M4", "data": split.fingerprint}
    save_predictions(paths["one"], positions, positions, planes, about)
    save_predictions(paths["two"], positions, positions, planes, about | {"method": "M3"})
    runs = compare_runs({name: paths[name] for name in ("one", "two")}, split)
    assert [run.name for run in runs.values()] == ["M4", "M3"]
    run = runs["one"]
    np.testing.assert_array_equal(run.truth.normals, planes.normals)
    assert run.diagonals.tolist() == [split[position].diagonal for position in positions]
    assert [label.perturbation for label in run.labels] == split.perturbations[positions].tolist()
    assert np.nansum(reliability(run).correct) == 1
    save_predictions(paths["other"], positions, positions, planes, about | {"data": "another"})
    with pytest.raises(ValueError, match=r"other\.safetensors was predicted on other data"):
        compare_runs({"other": paths["other"]}, split)
    save_predictions(paths["fewer"], positions[:1], positions[:1], PackedPlanes.pack([split[3].planes]), about)
    with pytest.raises(ValueError, match=r"fewer\.safetensors is of other clouds than .*one\.safetensors"):
        compare_runs({name: paths[name] for name in ("one", "fewer")}, split)
    assert compare_runs({}, split) == {}
