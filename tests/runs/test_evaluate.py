"""A run: what it leaves, that it goes on where it was killed, and that it knows when nothing is to do."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from symshrec.files.predictions import PredictionStore, load_metadata, load_predictions, save_predictions, take_clouds
from symshrec.metrics import evaluate as score
from symshrec.planes import PackedPlanes, Planes
from symshrec.runs.evaluate import datamodule_of, evaluate

ROOT = Path(__file__).parents[2]
CHEAP = ["data.limit=12", "data.batch_size=4"]
FREE = [*CHEAP, "method=oracle", "method.refine=false", "logger=none"]  # detects nothing


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
    overall = {metric: value for metric, group, *at, value in values(result) if (group, at) == ("all", [1.0, 0.01])}
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
    folders = (tmp_path / name / "predictions" / "predictions.safetensors" for name in ("m3_r1", "m3_r1_refine"))
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
    deadline = time.monotonic() + 400
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


def test_predictions_of_other_settings_are_kept_aside_and_taken_back(smoke_config, caplog, monkeypatch):
    first, folder = evaluate(smoke_config(*CHEAP)), Path(smoke_config().folder)
    stored = (folder / "predictions" / "predictions.safetensors").read_bytes()
    other = evaluate(smoke_config(*CHEAP, "method.neighbours=60"))
    assert other["seconds"]["detected_clouds"] == 12
    aside = folder / f"predictions.{first['key'][:12]}"
    assert "stored run differs in method.neighbours: 20 → 60" in caplog.text
    assert str(aside) in caplog.text
    assert (aside / "predictions.safetensors").read_bytes() == stored
    assert json.loads((aside / "metrics.json").read_text()) == first
    monkeypatch.setattr("symshrec.methods.m3.module.M3.detect_batch", lambda *_: pytest.fail("detected twice"))
    again = evaluate(smoke_config(*CHEAP))
    assert (values(again), again["seconds"], again["key"]) == (values(first), first["seconds"], first["key"])
    assert {path.name for path in folder.glob("predictions*")} == {"predictions", f"predictions.{other['key'][:12]}"}


def test_the_times_of_other_settings_do_not_count(smoke_config):
    evaluate(smoke_config(*FREE))
    (Path(smoke_config().folder) / "predictions" / "predictions.safetensors").unlink()
    assert evaluate(smoke_config(*FREE, "method.angle_deg=1"))["seconds"]["detected_clouds"] == 12


def test_predictions_that_tell_nothing_of_their_settings_are_kept_aside(smoke_config):
    place = Path(smoke_config().folder) / "predictions"
    PredictionStore(place, "a" * 64).append([0], [0], [Planes(np.eye(3)[:1], np.zeros((1, 3)))])
    assert evaluate(smoke_config(*FREE))["seconds"]["detected_clouds"] == 12
    assert PredictionStore(place.with_name("predictions.aaaaaaaaaaaa"), "a" * 64).done() == {0}


@pytest.mark.parametrize("harm", ["gone", "cut", "folder gone", "some clouds only"])
def test_a_finished_run_without_whole_predictions_makes_what_is_missing(smoke_config, harm):
    first = evaluate(smoke_config(*FREE))
    place = Path(smoke_config().folder) / "predictions"
    path, missing = place / "predictions.safetensors", 12
    if harm == "gone":
        path.unlink()
    elif harm == "cut":
        path.write_bytes(path.read_bytes()[:-50])
    elif harm == "folder gone":
        shutil.rmtree(place)
    else:
        whole, missing = load_predictions(path), 5
        few = take_clouds(whole.planes, np.arange(7))
        save_predictions(path, whole.positions[:7], whole.ids[:7], few, {"key": first["key"]})
    again = evaluate(smoke_config(*FREE))
    assert values(again) == values(first)
    assert len(load_predictions(path).positions) == 12
    before = 0 if harm == "folder gone" else 12
    assert again["seconds"]["detected_clouds"] == before + missing


@pytest.mark.parametrize("text", ["[]", "{}", '{"request_sha256": null}', "nonsense"])
def test_a_damaged_record_is_written_anew(smoke_config, text):
    first, path = evaluate(smoke_config(*FREE)), Path(smoke_config().folder) / "metrics.json"
    path.write_text(text)
    assert values(evaluate(smoke_config(*FREE))) == values(first) == values(json.loads(path.read_text()))


def test_a_partial_run_is_not_taken_for_a_finished_one(smoke_config):
    partial = evaluate(smoke_config(*FREE, "+trainer.limit_test_batches=2"))
    assert (partial["partial"], partial["data"]["clouds"]) == (["limit_test_batches"], 8)
    whole = evaluate(smoke_config(*FREE))
    assert (whole["partial"], whole["data"]["clouds"]) == (False, 12)
    assert whole["seconds"]["detected_clouds"] == 12


def test_another_threshold_of_counting_scores_again_without_detecting_again(smoke_config, monkeypatch):
    first = evaluate(smoke_config(*CHEAP))
    monkeypatch.setattr("symshrec.methods.m3.module.M3.detect_batch", lambda *_: pytest.fail("detected twice"))
    other = evaluate(smoke_config(*CHEAP, "method.count_threshold=2"))
    assert other["key"] == first["key"]
    assert other["request_sha256"] != first["request_sha256"]
    path = Path(smoke_config().folder) / "predictions" / "predictions.safetensors"
    assert float(load_metadata(path)["count_threshold"]) == 2


def test_refinement_takes_planes_that_were_kept_aside_in_its_own_folder(smoke_config, monkeypatch):
    plain = evaluate(smoke_config(*CHEAP, "data.limit=3"))
    monkeypatch.setattr("symshrec.methods.m3.module.M3.detect_batch", lambda *_: pytest.fail("detected twice"))
    assert evaluate(smoke_config(*CHEAP, "data.limit=3", "method.refine=true"))["key"] != plain["key"]
