"""A run: what it leaves, that it goes on where it was killed, and that it knows when nothing is to do."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from symshrec.files.predictions import load_predictions
from symshrec.metrics import evaluate as score
from symshrec.planes import PackedPlanes
from symshrec.runs.evaluate import datamodule_of, evaluate
from symshrec.runs.provenance import source_files

ROOT = Path(__file__).parents[2]
CHEAP = ["data.limit=12", "data.batch_size=4"]


def values(result: dict) -> list[tuple]:
    return [(row["metric"], row["group"], row["theta_deg"], row["epsilon"], row["value"]) for row in result["scores"]]


def test_a_run_leaves_predictions_configuration_and_metrics_that_agree(smoke_config):
    config = smoke_config(*CHEAP)
    result = evaluate(config)
    folder = Path(config.folder)
    assert json.loads((folder / "metrics.json").read_text()) == result
    assert result["data"]["clouds"] == 12
    assert len(result["data"]["manifest_sha256"]) == 64
    assert "neighbours: 20" in (folder / "config.yaml").read_text()
    stored = load_predictions(folder / "predictions" / "predictions.safetensors")
    split = datamodule_of(config).split("test")
    clouds = [split[int(position)] for position in stored.positions]
    truth = PackedPlanes.pack([cloud.planes for cloud in clouds])
    again = score(stored.planes, truth, np.array([cloud.diagonal for cloud in clouds])).mean()
    overall = {metric: value for metric, group, _, _, value in values(result) if group == "all"}
    assert overall["mAP"] == pytest.approx(again["mAP"], abs=1e-12)
    assert overall["PHC"] == pytest.approx(again["PHC"], abs=1e-12)


def test_another_tolerance_scores_again_without_detecting_again(smoke_config, monkeypatch):
    first = evaluate(smoke_config(*CHEAP))
    monkeypatch.setattr("symshrec.methods.m3.module.M3.detect_batch", lambda *_: pytest.fail("detected twice"))
    assert evaluate(smoke_config(*CHEAP)) == first
    swept = evaluate(smoke_config(*CHEAP, "tolerance=sweep"))
    assert {row[2:4] for row in values(swept)} > {(1.0, 0.01)}
    assert set(values(first)) <= set(values(swept))


def test_other_settings_do_not_reuse_old_predictions(smoke_config):
    first = evaluate(smoke_config(*CHEAP))
    other = evaluate(smoke_config(*CHEAP, "method.neighbours=60"))
    assert other["key"] != first["key"]
    assert other["seconds"]["detected_clouds"] == 12


def test_a_refined_run_starts_from_the_planes_of_the_run_without(smoke_config, tmp_path, monkeypatch):
    overrides = [*CHEAP, "data.limit=4", f"folder={tmp_path}/${{name}}"]
    plain = evaluate(smoke_config(*overrides))
    monkeypatch.setattr("symshrec.methods.m3.module.M3.detect_batch", lambda *_: pytest.fail("detected twice"))
    refined = evaluate(smoke_config(*overrides, "method.refine=true"))
    assert refined["key"] != plain["key"]
    assert (plain["name"], refined["name"]) == ("M3 (R1)", "M3 (R1) + refine")
    folders = (tmp_path / name / "predictions" / "predictions.safetensors" for name in ("m3_k200", "m3_k200_refine"))
    before, after = (load_predictions(path).planes for path in folders)
    np.testing.assert_array_equal(before.starts, after.starts)
    assert (after.confidences <= before.confidences).all()
    assert not np.array_equal(before.normals, after.normals)


def test_a_killed_run_goes_on_and_ends_the_same(smoke_config, smoke_root, tmp_path):
    whole = evaluate(smoke_config("data.batch_size=2"))
    runs = tmp_path / "killed"
    command = [sys.executable, "-m", "symshrec", "evaluate", "data=smoke", f"data.root={smoke_root}", f"folder={runs}"]
    command += ["method.neighbours=20", "data.batch_size=2", "logger=none", "paths.runs=" + str(tmp_path)]
    process = subprocess.Popen(
        command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )
    deadline = time.monotonic() + 60
    while len(list((runs / "predictions").glob("part-*"))) < 3 and time.monotonic() < deadline:
        time.sleep(0.02)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    assert not (runs / "metrics.json").exists()
    kept = len(list((runs / "predictions").glob("part-*")))
    assert kept >= 3
    resumed = evaluate(smoke_config("data.batch_size=2", f"folder={runs}"))
    assert abs(resumed["seconds"]["detected_clouds"] - 42) <= 2  # all but the batch in hand counts once
    assert values(resumed) == values(whole)
    files = [folder / "predictions" / "predictions.safetensors" for folder in (runs, tmp_path / "run")]
    np.testing.assert_array_equal(*(load_predictions(path).planes.normals for path in files))


def test_a_run_depends_on_the_code_that_decides_its_planes():
    names = {path.name for path in source_files("symshrec.methods.m3.module")}
    assert {"module.py", "pipeline.py", "spectrum.py", "planes.py"} <= names
    assert not {"base.py", "batch.py", "tables.py", "evaluation.py"} & names
