"""Training at tiny size: killed and resumed to the same weights, heard of when it goes wrong, then tested."""

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
import warnings
from pathlib import Path

import numpy as np
import pytest
import torch
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from symshrec.methods.m2.module import M2
from symshrec.methods.m2.settings import M2Settings, NetworkSettings
from symshrec.methods.settings import restored_settings
from symshrec.methods.weights import WeightsError, read_weights
from symshrec.runs.checkpoints import steps_done
from symshrec.runs.cross_validation import fold_spread
from symshrec.runs.evaluate import evaluate
from symshrec.runs.train import train
from symshrec.scans import CloudFileError

ROOT = Path(__file__).parents[2]
TINY_M1 = [
    "method=m1",
    "run=m1_r5",
    "train.init=null",
    "method.network.points=32",
    "method.network.channels=16",
    "method.network.layers=1",
    "method.network.features=16",
    "method.network.hidden=[16,16]",
    "method.loss.head_points=8",
]
TINY_M2 = [  # with the dropout and drop path of the published size
    "method=m2",
    "method.network.points=32",
    "method.network.groups=8",
    "method.network.neighbours=6",
    "method.network.width=12",
    "method.network.depth=2",
    "method.network.heads=2",
    "method.network.planes=6",
    "method.network.hidden=8",
    "method.loss.queries=8",
    "method.pretrain.decoder_depth=1",
]
TRAINING = [
    "train.batch_size=8",
    "train.steps_per_round=3",
    "train.epochs=3",
    "train.optimiser.learning_rate=1e-2",
    "train.validate_every=2",
    "train.clouds_shown=1",
    "trainer.enable_progress_bar=false",
]
AT_ONCE = "train.max_minutes=1e-9"  # a session is one step
TINY = [*TINY_M1, *TRAINING]
TRAININGS = {"m1": TINY, "m2": [*TINY_M2, *TRAINING], "m2_pretrain": [*TINY_M2, "run=m2_pretrain", *TRAINING]}


@pytest.fixture
def tiny(smoke_config, tmp_path):
    def compose(name, *overrides, method="m1"):
        return smoke_config(*TRAININGS[method], f"train.folder={tmp_path / name}", *overrides)

    return compose


def weights_of(config):
    return read_weights(f"{config.train.folder}/weights.safetensors", *TRAININGS).tensors


def assert_equal_weights(one, other):
    for name, tensor in weights_of(one).items():
        torch.testing.assert_close(weights_of(other)[name], tensor, rtol=0, atol=0)


@pytest.mark.parametrize("method", TRAININGS)
def test_stopped_after_every_step_a_training_ends_with_the_same_weights(tiny, method):
    """Within rounds, at their ends and before validations alike."""
    short = "train.epochs=1.5"
    whole, pieces = tiny("whole", short, method=method), tiny("pieces", short, AT_ONCE, method=method)
    result = train(whole)
    stops = 0
    while (finished := train(pieces)) is None:
        stops += 1
    assert stops == result["steps"] - 1
    assert_equal_weights(whole, pieces)
    assert finished["clouds"] == result["clouds"] == result["steps"] * 8
    assert finished["validation"] == result["validation"]
    assert ("val/mAP" in result["validation"]) == (method != "m2_pretrain")


def test_a_streamed_training_stopped_at_every_step_ends_as_one_with_a_process_that_generates(tiny, tmp_path):
    streamed = ["data.stream=true", "train.epochs=1.5", f"data.root={tmp_path / 'nothing'}"]
    whole, pieces = tiny("whole", *streamed, "data.workers=1"), tiny("pieces", *streamed, AT_ONCE)
    result = train(whole)
    while (finished := train(pieces)) is None:
        pass
    assert_equal_weights(whole, pieces)
    assert finished["validation"] == result["validation"]
    assert finished["epochs"] == pytest.approx(result["steps"] * 8 / 42, abs=1e-3)
    assert finished["data"].keys() == {"name", "stream_sha256"}
    assert not (tmp_path / "nothing").exists()


def test_a_training_on_mapped_points_ends_with_the_same_weights(tiny, smoke_root):
    held, mapped = tiny("held", "train.epochs=1"), tiny("mapped", "train.epochs=1", "data.in_memory=false")
    train(held)
    train(mapped)
    assert_equal_weights(held, mapped)
    assert list((smoke_root / "samples" / "train").glob("points-farthest-32.bin"))


def test_killed_within_a_long_round_a_training_ends_with_the_same_weights(tiny, smoke_root, small_benchmark):
    long = ["train.epochs=12", "train.steps_per_round=48"]
    whole, killed = tiny("whole", *long), tiny("killed", *long)
    train(whole)
    folder = Path(killed.train.folder)
    overrides = [*small_benchmark, f"data.root={smoke_root}", *TINY, *long, f"train.folder={folder}"]
    command = [sys.executable, "-m", "symshrec", "train", *overrides, "train.checkpoint_minutes=0"]
    process = subprocess.Popen(command, cwd=ROOT, env=os.environ | {"OMP_NUM_THREADS": "1"})
    try:
        deadline = time.monotonic() + 400
        while not (folder / "previous.ckpt").exists():
            assert process.poll() is None, "ended before its second checkpoint"
            assert time.monotonic() < deadline, "no second checkpoint in time"
            time.sleep(0.01)
    finally:
        process.send_signal(signal.SIGKILL)
        process.wait()
    assert 0 < steps_done(folder) < 48
    train(killed)
    assert_equal_weights(whole, killed)


def test_checkpoints_need_no_temporary_folder_and_a_session_no_sound_event_file(tiny, monkeypatch, tmp_path):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "not there"))
    config = tiny("folder", "train.epochs=1", AT_ONCE)
    assert train(config) is None
    folder = Path(config.train.folder)
    for events in (folder / "tensorboard").glob("events.*"):
        events.write_bytes(events.read_bytes()[:-3] + b"torn")
    for name in ("settings.json", "data.json"):
        (folder / name).write_bytes(b"{")
    while train(config) is None:
        pass
    kept = {path.name for path in folder.iterdir()}
    assert kept == {"data.json", "last.ckpt", "settings.json", "tensorboard", "training.json", "weights.safetensors"}


def test_a_training_goes_on_from_a_checkpoint_by_lightning_alone(tiny):
    """Without checksum, with the state of Lightning's own callback: as trainings wrote them at first."""
    whole, old = tiny("whole"), tiny("old", AT_ONCE)
    train(whole)
    while train(old) is None and steps_done(Path(old.train.folder)) < 3:
        pass
    folder = Path(old.train.folder)
    checkpoint = torch.load(folder / "last.ckpt", weights_only=True)
    checkpoint["callbacks"]["ModelCheckpoint{'monitor': None}"] = {"dirpath": "elsewhere"}
    for path in folder.glob("*.*"):
        path.unlink() if path.is_file() else None
    torch.save(checkpoint, folder / "last.ckpt")
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        train(tiny("old"))
    assert_equal_weights(whole, old)


def test_a_cool_down_branches_off_and_the_training_goes_on_as_if_nothing_had_been(tiny):
    """At a constant rate weights can be made of any state; the rate of the branch falls to zero."""
    constant = ["train.optimiser.schedule=constant", "train.optimiser.warmup_steps=2", "train.epochs=2"]
    whole, pieces = tiny("whole", *constant), tiny("pieces", *constant, AT_ONCE)
    record = train(whole)
    with pytest.raises(ValueError, match=r"last\.ckpt does not exist; train first"):
        train(tiny("pieces", *constant, "train.cooldown=1"))
    assert train(pieces) is None
    cooling = tiny("pieces", *constant, "train.cooldown=1")
    branch = train(cooling)
    folder = Path(pieces.train.folder) / "cooldown_00001"
    assert branch["steps"] == 9  # a round of 3 steps, then an epoch of 33 clouds in whole rounds
    rates = EventAccumulator(str(folder / "tensorboard")).Reload().Scalars("lr-AdamW/pg1")
    assert [each.value for each in rates] == sorted((each.value for each in rates), reverse=True)
    assert rates[-1].value < 0.1 * whole.train.optimiser.learning_rate
    while (finished := train(pieces)) is None:
        pass
    assert_equal_weights(whole, pieces)
    after = train(tiny("after", f"train.init={folder / 'weights.safetensors'}", "train.epochs=1"))
    assert (after["before"]["clouds"], after["before"]["sha256"]) == (72, branch["weights_sha256"])
    assert finished["clouds"] == record["clouds"]


def test_m2_starts_from_the_encoder_of_a_pre_training_and_ends_as_a_detector(tiny, smoke_config):
    before = tiny("before", method="m2_pretrain")
    train(before)
    file = f"{before.train.folder}/weights.safetensors"
    after = tiny("after", f"train.init={file}", "method.confidence=loss", method="m2")
    method = M2(M2Settings(network=restored_settings(NetworkSettings, read_weights(file, "m2_pretrain").network)))
    method.start_from(file)
    started = method.networks[0].encoder.state_dict()
    for name, tensor in weights_of(before).items():
        if name.startswith("encoder."):
            torch.testing.assert_close(started[name.removeprefix("encoder.")], tensor, rtol=0, atol=0)
    record = train(after)
    assert record["method"] == "m2"
    assert record["validation"]["val/planes"] >= 1
    weights = f"method.weights=[{after.train.folder}/weights.safetensors]"
    assert evaluate(smoke_config(*TRAININGS["m2"], weights, "data.limit=4"))["weights"]
    with pytest.raises(WeightsError, match="holds weights of m2_pretrain, not of m2"):
        M2(M2Settings(weights=[file]))
    with pytest.raises(WeightsError, match="do not fit"):
        train(tiny("wider", f"train.init={file}", "method.network.width=24", method="m2"))


def test_m2_learns_from_any_folder_of_clouds_and_meshes(tiny, tmp_path):
    clouds, rng = tmp_path / "clouds", np.random.default_rng(0)
    (clouds / "below").mkdir(parents=True)
    for number in range(19):
        np.save(clouds / "below" / f"{number}.npy", rng.normal(size=(60, 3)))
    (clouds / "mesh.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 2 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\n")
    data = ["data=clouds", f"data.root={clouds}"]
    config = tiny("pretrain", *data, method="m2_pretrain")
    assert list(train(config)["validation"]) == ["val/loss"]
    events = EventAccumulator(f"{config.train.folder}/tensorboard").Reload()
    assert [tag.partition("/")[0] for tag in events.Tags()["images"]] == ["clouds"]
    assert train(tiny("m2", *data, method="m2"))["validation"]["val/symmetry"] > 0
    with pytest.raises(ValueError, match=r"data\.kind=clouds has no split 'test' with truth"):
        evaluate(tiny("m2", *data, "method.weights=[]", method="m2"))
    (clouds / "broken.xyz").write_text("1 2 three\n")
    with pytest.raises(CloudFileError, match=r"broken\.xyz:1: .*three"):
        train(tiny("broken", *data, method="m2_pretrain"))


def test_a_training_by_other_settings_is_not_touched(tiny):
    train(tiny("folder"))
    before = Path(tiny("folder").train.folder, "weights.safetensors").read_bytes()
    assert train(tiny("folder", "train.validate_every=1"))["name"] == "M1 (R5)"
    with pytest.raises(ValueError, match=r"other settings \(train\.optimiser\.clip\); name another train\.folder"):
        train(tiny("folder", "train.optimiser.clip=2"))
    assert Path(tiny("folder").train.folder, "weights.safetensors").read_bytes() == before


def test_folds_have_a_mean_and_a_spread(tiny):
    """Each validates on other clouds; a training with other settings does not count."""
    folds = [tiny("f${data.fold}", f"data.fold={fold}", "train.epochs=1") for fold in (0, 1)]
    records = [train(config) for config in folds]
    assert fold_spread(folds[0].copy())[0] == fold_spread(folds[1])[0] == [0, 1]
    losses = [each["validation"]["val/loss"] for each in records]
    assert losses[0] != losses[1]
    assert fold_spread(folds[1])[1]["val/loss"] == pytest.approx((np.mean(losses), np.std(losses, ddof=1)))
    other = tiny("f${data.fold}", "data.fold=2", "train.epochs=2")
    train(other)
    assert fold_spread(other) == ([], {})


def test_a_loss_that_is_not_finite_ends_the_training_at_once(tiny, monkeypatch):
    broken = {"loss": torch.tensor(torch.nan, requires_grad=True), "vector": torch.tensor(2.0)}
    monkeypatch.setattr("symshrec.methods.m1.module.M1.losses", lambda *_: broken)
    with pytest.raises(
        FloatingPointError, match=r"step 0 is not finite \(loss nan, vector 2\); lower train\.optimiser"
    ):
        train(tiny("folder"))


def test_a_method_without_a_network_is_refused(smoke_config, tmp_path):
    with pytest.raises(ValueError, match="method=m3 has nothing to train"):
        train(smoke_config(f"train.folder={tmp_path / 'm3'}"))


def test_what_was_trained_is_tested_and_recorded(tiny, smoke_config):
    config = tiny("folder", "train.epochs=40", "train.rotate=true")
    record = train(config)
    folder = Path(config.train.folder)
    assert json.loads((folder / "training.json").read_text()) == record
    assert 0 <= record["share_waiting_for_data"] < 0.5
    assert any((folder / "tensorboard").glob("events.out.tfevents.*"))
    result = evaluate(smoke_config(*TINY, f"method.weights=[{folder / 'weights.safetensors'}]", "data.limit=4"))
    (used,) = result["weights"]
    assert used["sha256"] == record["weights_sha256"]
    assert used["about"].startswith("32 points, 40")
    other = evaluate(smoke_config(*TINY, f"method.weights=[{folder / 'weights.safetensors'}]", "data.limit=5"))
    assert other["key"] != result["key"]


def test_a_partial_training_leaves_nothing_to_go_on_from(tiny):
    partial = train(tiny("folder", "+trainer.fast_dev_run=true"))
    assert partial["partial"] == ["fast_dev_run"]
    assert (partial["steps"], "val/mAP" in partial["validation"]) == (1, True)
    assert train(tiny("folder", "+trainer.max_steps=2", "logger=none"))["steps"] == 2
    assert not [path for path in Path(tiny("folder").train.folder).rglob("*") if path.is_file()]
    with pytest.raises(ValueError, match=r"trainer\.devices is auto; a training needs their number"):
        train(tiny("folder", "trainer.devices=auto"))


def test_a_training_starts_from_a_given_checkpoint(tiny, tmp_path):
    whole, begun = tiny("whole"), tiny("begun", "train.max_minutes=0.00001")
    train(whole)
    assert train(begun) is None
    checkpoint = f"{begun.train.folder}/last.ckpt"
    gone_on = tiny("gone_on", f"ckpt_path={checkpoint}", "logger=csv")
    train(gone_on)
    assert_equal_weights(whole, gone_on)
    assert "val/mAP" in Path(gone_on.train.folder, "csv", "metrics.csv").read_text()
    (tmp_path / "bad.ckpt").write_bytes(Path(checkpoint).read_bytes()[:5000])
    with pytest.raises(ValueError, match=r"bad\.ckpt is not a whole checkpoint of a Lightning training"):
        train(tiny("other", f"ckpt_path={tmp_path / 'bad.ckpt'}"))
    with pytest.raises(ValueError, match=r"no file nowhere\.ckpt"):
        train(tiny("other", "ckpt_path=nowhere.ckpt"))
    with pytest.raises(ValueError, match=r"last\.ckpt is of another network: networks\.0"):
        train(tiny("other", f"ckpt_path={checkpoint}", "method.network.channels=8"))
    with pytest.raises(ValueError, match=r"holds a training with other settings \(ckpt_path\)"):
        train(tiny("gone_on"))
    assert not list(Path(tiny("other").train.folder).glob("*.ckpt"))
