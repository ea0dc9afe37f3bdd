"""Lightning's Trainer, its loggers and callbacks, as a configuration describes them."""

import csv
from importlib.util import find_spec
from pathlib import Path

import pytest

from symshrec.runs.evaluate import evaluate
from symshrec.runs.train import chosen_precision

CHEAP = ["data.limit=4", "data.batch_size=2", "logger=none"]


@pytest.mark.parametrize("short", ["+trainer.fast_dev_run=true", "+trainer.limit_test_batches=1"])
def test_a_partial_run_neither_reads_nor_leaves_a_stored_one(short, smoke_config):
    config = smoke_config(*CHEAP)
    evaluate(config)
    before = {path: path.read_bytes() for path in Path(config.folder).rglob("*") if path.is_file()}
    partial = evaluate(smoke_config(*CHEAP, short, "method.neighbours=40"))
    assert partial["partial"] == [short.removeprefix("+trainer.").partition("=")[0]]
    assert partial["data"]["clouds"] == 2
    assert {path: path.read_bytes() for path in Path(config.folder).rglob("*") if path.is_file()} == before


def test_an_argument_that_shortens_nothing_leaves_a_finished_run(smoke_config):
    result = evaluate(smoke_config(*CHEAP, "+trainer.limit_test_batches=1.0", "+trainer.benchmark=false"))
    assert not result["partial"]
    assert result["data"]["clouds"] == 4


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("+trainer.fast_run=true", r"trainer\.fast_run: Lightning's Trainer has no such argument; it has accelerator"),
        (
            "+trainer.limit_test_batches=-3",
            r"refuses .*trainer\.limit_test_batches=-3: ",
        ),
        ("trainer.accelerator=abacus", r"invalid accelerator name"),
        ("+trainer.callbacks=[]", r"trainer\.callbacks is chosen with callbacks=…"),
        ("+callbacks.mine.patience=3", r"callbacks\.mine needs a _target_"),
        ("+callbacks.mine._target_=nowhere.Mine", r"callbacks\.mine: .*nowhere"),
        ("callbacks.tested.clouds=-1", r"callbacks\.tested: tensorboard\.clouds is -1"),
        ("ckpt_path=last.ckpt", r"ckpt_path is for train; evaluate takes weights"),
        pytest.param(
            "logger=wandb",
            r"logger\.wandb: wandb is not installed; pip install 'symshrec\[wandb\]'",
            marks=pytest.mark.skipif(find_spec("wandb") is not None, reason="wandb is installed"),
        ),
    ],
)
def test_what_lightning_cannot_use_is_named_in_one_line(override, message, smoke_config):
    with pytest.raises(ValueError, match=message) as problem:
        evaluate(smoke_config(*CHEAP, override))
    assert "\n" not in str(problem.value)


def test_loggers_and_callbacks_of_ones_own_are_given_the_run(smoke_config, tmp_path, monkeypatch):
    (tmp_path / "seen.py").write_text(
        "from lightning import Callback\n"
        "class Seen(Callback):\n"
        "    def __init__(self, file): self.file = file\n"
        "    def on_test_end(self, trainer, method): open(self.file, 'w').write(type(method).__name__)\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    own = ["+callbacks.mine._target_=seen.Seen", f"+callbacks.mine.file={tmp_path / 'seen'}"]
    result = evaluate(smoke_config(*CHEAP, *own, "logger=[csv,tensorboard]"))
    assert (tmp_path / "seen").read_text() == "M3"
    (row,) = csv.DictReader((tmp_path / "run" / "csv" / "metrics.csv").read_text().splitlines())
    mean, *_ = [each["value"] for each in result["scores"] if (each["metric"], each["group"]) == ("mAP", "all")]
    assert float(row["mAP/all"]) == mean
    assert any((tmp_path / "run" / "tensorboard").iterdir())


@pytest.mark.parametrize(("bfloat16", "taken"), [(True, "bf16-mixed"), (False, "32-true")])
def test_precision_follows_the_processor(monkeypatch, bfloat16, taken):
    monkeypatch.setattr("torch.ops.mkldnn._is_mkldnn_bf16_supported", lambda: bfloat16)
    assert chosen_precision("auto", "cpu") == taken
    assert chosen_precision("auto", "gpu") == "bf16-mixed"
    assert chosen_precision("64-true", "cpu") == "64-true"
