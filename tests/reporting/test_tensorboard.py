from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from lightning import Trainer
from lightning.pytorch.loggers import TensorBoardLogger
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
from tensorboard.plugins.hparams.plugin_data_pb2 import HParamsPluginData
from torch.utils.data import DataLoader

from symshrec.benchmark.cloud import UNKNOWN, Labels
from symshrec.data.batch import Batch
from symshrec.methods.base import SymmetryMethod
from symshrec.methods.m1.module import M1
from symshrec.methods.m1.settings import M1Settings, NetworkSettings
from symshrec.methods.settings import plain_settings
from symshrec.metrics import METRICS, GroupScore
from symshrec.planes import Planes
from symshrec.reporting.figures.tensorboard import (
    TensorBoardResults,
    TensorBoardTraining,
    _by_group,
    group_kinds,
    telling,
)

TRUE = Planes([[1, 0, 0], [0, 1, 0]], np.zeros((2, 3)))


class FirstPlane(SymmetryMethod):
    """Finds the x = 0 plane of every cloud, and doubts a wrong one."""

    def __init__(self, strength: float = 0.5):
        super().__init__()
        self.save_hyperparameters()

    def detect(self, points):
        return Planes([[1, 0, 0], [0, 0, 1]], np.zeros((2, 3)), [0.9, 0.1])


def a_batch(start, clouds=2, points=40):
    generator = torch.Generator().manual_seed(start)
    return Batch(
        points=torch.randn(clouds * points, 3, generator=generator),
        lengths=torch.full((clouds,), points),
        truth=[TRUE] * clouds,
        labels=[Labels("astroid", "cone", f"P{(start + i) % 6}") for i in range(clouds)],
        positions=list(range(start, start + clouds)),
        ids=list(range(start, start + clouds)),
        names=[str(start + i) for i in range(clouds)],
        diagonals=torch.full((clouds,), 2.0, dtype=torch.float64),
    )


def logged(folder, batches, clouds):
    trainer = Trainer(
        accelerator="cpu",
        logger=TensorBoardLogger(folder, name="", version="tensorboard", default_hp_metric=False),
        callbacks=[TensorBoardResults(clouds=clouds)],
        enable_checkpointing=False,
        enable_progress_bar=False,
        enable_model_summary=False,
    )
    trainer.test(FirstPlane(), DataLoader(batches, batch_size=None), verbose=False)
    return events_in(folder / "tensorboard")


def events_in(folder):
    accumulator = EventAccumulator(str(folder), size_guidance={"tensors": 0})
    accumulator.Reload()
    return accumulator


@pytest.fixture(scope="module")
def events(tmp_path_factory):
    return logged(tmp_path_factory.mktemp("runs"), [a_batch(0), a_batch(2), a_batch(4)], clouds=3)


def test_few_scalars_and_a_figure_for_each_kind_of_group(events):
    scores = {tag: events.Scalars(tag)[0].value for tag in events.Tags()["scalars"]}
    assert scores.keys() == {f"overall/{name}" for name in METRICS}
    assert scores["overall/PHC"] == scores["overall/count_accuracy"] + 1 == 1
    assert scores["overall/recall"] == scores["overall/recall_aware_mAP"] == 0.5


def test_bars_are_the_scores_of_their_groups():
    groups = group_kinds([Labels("b", "cone", "P10"), Labels("a", "cone", "P2"), Labels("a", UNKNOWN, "P2")])
    assert groups == {"perturbation": ["P2", "P10"], "family": ["a", "b"], "solid": ["cone"]}
    values = {"P2": 0.25, "P10": 0.75, "all": 0.5}
    rows = [GroupScore(metric, name, 1.0, 0.01, value, 3, 0.1) for metric in METRICS for name, value in values.items()]
    for ax in _by_group(rows, groups["perturbation"]).axes:
        assert [bar.get_height() for bar in ax.patches] == [0.25, 0.75]


def test_clouds_of_no_known_group_are_scored_all_the_same(tmp_path):
    events = logged(tmp_path, [replace(a_batch(0), labels=[Labels(), Labels()])], clouds=0)
    assert events.Tags()["images"] == ["precision_recall"]
    assert events.Scalars("overall/recall")[0].value == 0.5


def test_hyperparameters_are_those_that_tell_runs_apart(events):
    content = events.summary_metadata["_hparams_/session_start_info"].plugin_data.content
    shown = HParamsPluginData.FromString(content).session_start_info.hparams
    values = {name: each.string_value or each.number_value for name, each in shown.items()}
    assert values == {"method": "FirstPlane", "strength": 0.5}
    settings = M1Settings(name="m1", refine=True, workers=2, network=NetworkSettings(points=32))
    method = M1(settings)
    method.hparams.update(plain_settings(settings))  # as runs do
    assert telling(method) == {"method": "M1", "refine": True, "network.points": 32}


def test_what_a_training_ended_with_stands_at_its_last_step(tmp_path):
    logger = TensorBoardLogger(tmp_path, name="", version="tensorboard", default_hp_metric=False)
    trainer = SimpleNamespace(
        is_global_zero=True, logger=logger, global_step=500, callback_metrics={"val/mAP": 0.5, "train/loss": 2.0}
    )
    TensorBoardTraining().on_train_end(trainer, FirstPlane())
    events = events_in(tmp_path / "tensorboard")
    assert events.Tags()["scalars"] == ["val/mAP"]
    assert [(each.step, each.value) for each in events.Scalars("val/mAP")] == [(500, 0.5)]


def test_curve_and_the_first_clouds_are_drawn(events):
    assert events.Tags()["images"] == [
        *(f"scores/by {kind}" for kind in ("perturbation", "family", "solid")),
        "precision_recall",
        *(f"clouds/{position:05d} astroid cone P{position}" for position in range(3)),
    ]
    assert all(len(events.Images(tag)[0].encoded_image_string) > 1000 for tag in events.Tags()["images"])


def test_negative_number_of_clouds_is_refused():
    with pytest.raises(ValueError, match=r"tensorboard\.clouds is -1"):
        TensorBoardResults(clouds=-1)
