"""`symshrec score`: the table and JSON of anyone's results, and what is missing from them."""

import json
import re

import numpy as np
import pytest

from symshrec.benchmark.official import write_results, write_track
from symshrec.benchmark.shards import ShardedSplit
from symshrec.cli import main, parallel
from symshrec.files.predictions import save_predictions
from symshrec.metrics import METRICS, evaluate
from symshrec.planes import PackedPlanes, Planes


def disturbed(truth: Planes, rng: np.random.Generator) -> Planes:
    """The true planes, some a little off, and a few others."""
    normals = truth.normals + rng.normal(scale=0.008, size=truth.normals.shape)
    extra = int(rng.integers(0, 4))
    return Planes(
        np.concatenate([normals, rng.normal(size=(extra, 3))]),
        np.concatenate([truth.points, rng.normal(size=(extra, 3))]),
        rng.random(len(truth) + extra).round(1),
    )


@pytest.fixture(scope="module")
def clouds(shards):
    split = ShardedSplit(shards, "test")
    return [split[position] for position in range(len(split))]


@pytest.fixture(scope="module")
def predicted(clouds):
    rng = np.random.default_rng(0)
    return [disturbed(cloud.planes, rng) for cloud in clouds]


@pytest.fixture
def results(predicted, tmp_path):
    folder = tmp_path / "results"
    folder.mkdir()
    for cloud, planes in enumerate(predicted):
        write_results(folder / f"points{cloud}_res.txt", planes)
    return folder


def report(capsys, *arguments) -> dict:
    assert main(["score", *map(str, arguments), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def expected(clouds, predicted, count_threshold=-np.inf, theta_deg=1.0, epsilon=0.01):
    truth = PackedPlanes.pack([cloud.planes for cloud in clouds])
    diagonals = [cloud.diagonal for cloud in clouds]
    return evaluate(PackedPlanes.pack(predicted), truth, diagonals, [theta_deg], [epsilon], count_threshold)


def test_shards_give_the_scores_of_the_metrics_by_group(shards, results, clouds, predicted, capsys):
    found = report(capsys, results, shards, "--theta-deg", 0.7, "--epsilon", 0.02, "--count-threshold", 0.4)
    scores = expected(clouds, predicted, 0.4, 0.7, 0.02)
    for group, values in found["scores"].items():
        names = [("all", each.labels.perturbation, each.labels.family, each.labels.solid) for each in clouds]
        mask = np.array([group in each for each in names])
        assert values["clouds"] == mask.sum()
        assert [values[name] for name in METRICS] == pytest.approx(list(scores.mean(mask=mask).values()), abs=1e-12)
    assert 0.1 < found["scores"]["all"]["mAP"] < 0.99
    assert {"all", "P0", "P5", "citrus", "cone"} <= found["scores"].keys()
    assert found["precision_at_recall"] == pytest.approx(scores.mean_curve().tolist())
    assert (found["theta_deg"], found["epsilon"], found["count_threshold"]) == (0.7, 0.02, 0.4)
    assert found["missing"] == found["unknown"] == []


def test_an_official_folder_gives_the_same_wherever_its_points_are(results, clouds, predicted, tmp_path, capsys):
    truth, points = tmp_path / "truth", tmp_path / "points"
    write_track(clouds, truth)
    found = report(capsys, results, truth)
    assert found["scores"].keys() == {"all"}
    assert found["scores"]["all"]["mAP"] == pytest.approx(expected(clouds, predicted).mean()["mAP"], abs=1e-12)
    points.mkdir()
    for cloud in clouds:
        (truth / f"points{cloud.id}.txt").rename(points / f"points{cloud.id}.txt")
    assert report(capsys, results, truth, "--points", points) == found
    assert main(["score", str(results), str(truth)]) == 2
    assert "points0.txt, are missing" in capsys.readouterr().err
    assert main(["score", str(results), str(points)]) == 2
    assert "no truth to score against" in capsys.readouterr().err


def test_a_missing_result_counts_0_and_is_told(shards, results, clouds, predicted, capsys):
    for cloud in (3, 11):
        (results / f"points{cloud}_res.txt").unlink()
    write_results(results / "points99_res.txt", predicted[0])
    found = report(capsys, results, shards)
    whole = expected(clouds, predicted)
    kept = np.setdiff1d(np.arange(len(clouds)), [3, 11])
    for name, value in whole.mean(mask=kept).items():
        assert found["scores"]["all"][name] == pytest.approx(value * len(kept) / len(clouds), abs=1e-12)
    assert found["missing"] == [3, 11]
    assert found["unknown"] == [99]
    assert main(["score", str(results), str(shards)]) == 0
    told = capsys.readouterr().err
    assert "2 of 18 results are missing and count 0: points3_res.txt, points11_res.txt" in told
    assert "1 results are of clouds that the truth does not hold and do not count: points99_res.txt" in told


def test_no_answer_is_never_right_where_no_plane_is(tmp_path, clouds, predicted, capsys):
    asymmetric = [type(cloud)(cloud.points, Planes.empty(), cloud.labels, cloud.id, cloud.name) for cloud in clouds[:2]]
    write_track([*asymmetric, clouds[2]], tmp_path / "truth")
    (tmp_path / "results").mkdir()
    write_results(tmp_path / "results" / "points0_res.txt", Planes.empty())
    found = report(capsys, tmp_path / "results", tmp_path / "truth")["scores"]["all"]
    assert found["count_accuracy"] == found["recall"] == found["recall_aware_mAP"] == pytest.approx(1 / 3)


def test_a_subset_narrows_the_clouds(shards, results, clouds, predicted, tmp_path, capsys):
    subset = tmp_path / "subset.txt"
    subset.write_text("9\n2\n")
    found = report(capsys, results, shards, "--subset", subset)
    scores = expected([clouds[2], clouds[9]], [predicted[2], predicted[9]])
    assert {name: found["scores"]["all"][name] for name in METRICS} == pytest.approx(scores.mean())
    assert found["unknown"] == []
    subset.write_text("9\n18\n")
    assert main(["score", str(results), str(shards), "--subset", str(subset)]) == 2
    assert "subset.txt:2: there is no cloud 18" in capsys.readouterr().err


def test_a_predictions_file_scores_as_its_folder_does(shards, results, predicted, tmp_path, capsys):
    path = tmp_path / "predictions.safetensors"
    ids = range(len(predicted))
    save_predictions(path, ids, ids, PackedPlanes.pack(predicted), {"count_threshold": "0.4"})
    assert report(capsys, path, shards) == report(capsys, results, shards, "--count-threshold", 0.4)


def test_several_processes_score_as_one_does(shards, results, monkeypatch, capsys):
    alone = report(capsys, results, shards, "--workers", 1)
    monkeypatch.setattr(parallel, "ALONE", 1)
    monkeypatch.setattr(parallel, "CHUNK", 5)
    assert report(capsys, results, shards, "--workers", 2) == alone
    (results / "points7_res.txt").write_text("1\nno plane\n")
    assert main(["score", str(results), str(shards), "--workers", "2"]) == 2
    assert "points7_res.txt:2: 2 columns" in capsys.readouterr().err


def test_the_table_is_aligned(shards, results, capsys):
    assert main(["score", str(results), str(shards)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split("  ")[-1] == "count accuracy"
    assert lines[1].startswith("all ")
    assert len({len(line) for line in lines}) == 1


def test_a_user_error_is_one_line(shards, results, tmp_path, capsys):
    for arguments, problem in (
        ([tmp_path / "nowhere", shards], "nowhere: there is no such folder"),
        ([results, tmp_path / "nowhere"], "nowhere: there is no such folder"),
        ([results, shards, "--split", "valid"], "no split 'valid'"),
        ([results, shards, "--points", results], "leave out --points"),
        ([results, shards, "--subset", tmp_path / "nowhere"], "nowhere"),
    ):
        assert main(["score", *map(str, arguments)]) == 2
        told = capsys.readouterr().err
        assert told.startswith("symshrec score: ")
        assert problem in told
        assert told.count("\n") == 1


def test_confidences_outside_their_range_are_warned_of_once_and_scored_as_ever(
    shards, results, predicted, tmp_path, capsys
):
    before = report(capsys, results, shards)
    assert "outside [0, 1]" not in capsys.readouterr().err
    for cloud, planes in enumerate(predicted):
        if (results / f"points{cloud}_res.txt").exists() and len(planes):
            shifted = Planes(planes.normals, planes.points, planes.confidences + 1.5)
            write_results(results / f"points{cloud}_res.txt", shifted)
    assert main(["score", str(results), str(shards), "--json"]) == 0
    told = capsys.readouterr()
    assert json.loads(told.out) == before
    (line,) = [line for line in told.err.splitlines() if "outside" in line]
    assert re.fullmatch(r".*points\d+_res\.txt: \d+ confidences are outside \[0, 1\] \(in \d+ clouds\); .*", line)
    path = tmp_path / "predictions.safetensors"
    odd = [Planes(each.normals, each.points, -each.confidences) for each in predicted]
    save_predictions(path, range(len(odd)), range(len(odd)), PackedPlanes.pack(odd), {})
    assert main(["score", str(path), str(shards)]) == 0
    assert capsys.readouterr().err.count("confidences are outside [0, 1]") == 1


@pytest.mark.parametrize("threshold", ["high", "nan"])
def test_a_predictions_file_with_a_threshold_that_is_none_is_refused(threshold, shards, predicted, tmp_path, capsys):
    path = tmp_path / "predictions.safetensors"
    ids = range(len(predicted))
    save_predictions(path, ids, ids, PackedPlanes.pack(predicted), {"count_threshold": threshold})
    assert main(["score", str(path), str(shards)]) == 2
    assert f"its count_threshold is {threshold!r}" in capsys.readouterr().err
