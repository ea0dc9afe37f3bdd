"""The oracle: perfect as it stands, a plane for a plane when refined, and of no use on points alone."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import symshrec
from symshrec.benchmark.shards import ShardedSplit
from symshrec.cli import main
from symshrec.data.datamodule import collate
from symshrec.files.predictions import load_predictions
from symshrec.methods.oracle.module import Oracle
from symshrec.methods.oracle.settings import OracleSettings
from symshrec.planes import axis_angles
from symshrec.reporting.tables.results import find_score
from symshrec.runs.config import load
from symshrec.runs.evaluate import evaluate


@pytest.fixture
def oracle(smoke_root, tmp_path):
    """overrides → what the experiment `oracle` measures on a few clouds of the smoke benchmark, and its planes."""

    def run(*overrides: str):
        places = [f"data.root={smoke_root}", f"folder={tmp_path}/${{name}}", "trainer.enable_progress_bar=false"]
        config = load(["experiment=oracle", "data=smoke", "data.limit=5", "data.batch_size=3", *places, *overrides])
        result = evaluate(config)
        assert json.loads((Path(config.folder) / "metrics.json").read_text()) == result
        return result, load_predictions(Path(config.folder) / "predictions" / "predictions.safetensors").planes

    return run


@pytest.fixture
def clouds(smoke_root):
    split = ShardedSplit(smoke_root, "test")
    return [split[position] for position in range(6)]


def batch_of(clouds, first=0):
    return collate([(position, cloud, None) for position, cloud in enumerate(clouds, first)])


def test_the_exact_planes_score_one_everywhere(oracle):
    result, _ = oracle("run=oracle_exact", "method.refine=false")
    assert (result["name"], result["oracle"]) == ("Exact truth", True)
    assert {row["value"] for row in result["scores"]} - {None} == {1.0}


def test_refined_it_finds_the_planes_that_it_does_not_give(oracle):
    before, given = oracle("method.refine=false")
    after, refined = oracle()
    assert (before["name"], after["name"]) == ("Truth", "Truth + refine")
    np.testing.assert_array_equal(refined.starts, given.starts)
    assert (refined.confidences > 0.5).mean() > 0.8  # true planes, whose confidences refinement all but leaves
    assert find_score(before, "mAP", "all") == 1
    assert find_score(after, "count_accuracy", "all") >= 0.8
    assert find_score(before, "mAP", "all", 0.1, 0.001) == 0 < find_score(after, "mAP", "all", 0.1, 0.001)


def test_errors_are_as_large_as_asked_for_and_independent_of_the_batch(clouds):
    method = Oracle(OracleSettings(angle_deg=2, offset=0.01, refine=False))
    found = method.planes_of(batch_of(clouds))
    for cloud, planes in zip(clouds, found, strict=True):
        angles = np.diagonal(axis_angles(planes.normals, cloud.planes.normals))
        np.testing.assert_allclose(np.rad2deg(angles), 2, atol=1e-9)
        gaps = np.einsum("kd,kd->k", planes.points - cloud.planes.points, cloud.planes.normals)
        np.testing.assert_allclose(np.abs(gaps), 0.01 * cloud.diagonal, rtol=1e-9)
        assert (planes.confidences == 1).all()
    (alone,) = method.planes_of(batch_of(clouds[4:5], first=4))
    np.testing.assert_array_equal(alone.normals, found[4].normals)


def test_clouds_without_truth_are_refused_by_name(clouds):
    withheld = replace(clouds[1], planes=None)
    with pytest.raises(ValueError, match=f"cloud {withheld.name} has no true planes; method oracle needs labelled"):
        Oracle().planes_of(batch_of([clouds[0], withheld]))


def test_errors_name_the_argument():
    with pytest.raises(ValueError, match=r"angle_deg is 91, expected a number in \[0, 90\]"):
        OracleSettings(angle_deg=91)
    with pytest.raises(ValueError, match="offset is -1"):
        OracleSettings(offset=-1)


def test_points_alone_are_one_line_of_error(tmp_path, capsys):
    points = np.random.default_rng(0).normal(size=(50, 3))
    with pytest.raises(ValueError, match="method oracle gives labelled clouds their own planes"):
        symshrec.detect(points, method="oracle")
    np.savetxt(tmp_path / "cloud.xyz", points)
    assert main(["detect", str(tmp_path / "cloud.xyz"), "--method", "oracle"]) == 2
    told = capsys.readouterr()
    assert told.out == ""
    assert len(told.err.splitlines()) == 1
    assert "method oracle gives labelled clouds" in told.err
