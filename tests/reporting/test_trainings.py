"""The curves of trainings, out of TensorBoard files as they are left by several sessions."""

import json

import pytest
from PIL import Image
from torch.utils.tensorboard import SummaryWriter

from symshrec.reporting.figures.trainings import training_curves, write_training_curves

SETTINGS = {"data.folds": 5, "data.limit": None, "data.benchmark.splits.train.clouds": 1000}
SETTINGS |= {"train.batch_size": 8, "trainer.devices": 1}  # 100 steps an epoch


@pytest.fixture
def train(tmp_path):
    """Leave what the sessions of a training leave: validation mAPs by step."""

    def left(name, *sessions, settings=SETTINGS):
        for number, values in enumerate(sessions):
            with SummaryWriter(tmp_path / "training" / name / "tensorboard", filename_suffix=f".{number}") as writer:
                writer.add_scalar("train/loss", 1.0, 1)
                for step, value in values.items():
                    writer.add_scalar("val/mAP", value, step)
        (tmp_path / "training" / name / "settings.json").write_text(json.dumps(settings))
        return tmp_path / "training"

    return left


def test_epochs_are_counted_over_all_sessions_of_a_training(train, tmp_path):
    train("m1_r4", {100: 0.25, 200: 0.5}, {300: 0.75, 0: 0.75})
    train("m1_r4/cooldown_00002", {250: 0.875})
    folder = train("unvalidated", {})
    curves = training_curves(folder)
    assert curves == {
        "m1_r4": [(1.0, 0.25), (2.0, 0.5), (3.0, 0.75)],
        "m1_r4/cooldown_00002": [(2.5, 0.875)],
    }
    figure, numbers = write_training_curves(curves, tmp_path / "results")
    assert Image.open(figure).size[0] > 500
    assert numbers.read_text().splitlines()[:2] == ["training,epochs,validation_mAP", "m1_r4,1.0,0.25"]


def test_epochs_go_on_from_the_weights_before_and_earlier_trainings_keep_their_lines(train, tmp_path):
    folder, results = train("m1_r4", {100: 0.25}), tmp_path / "results"
    results.mkdir()
    (folder / "m1_r4" / "training.json").write_text(json.dumps({"before": {"epochs": 29.5}}))
    (results / "training.csv").write_text(
        "training,epochs,validation_mAP\nm1_r4,1.0,0.1\nm1_r3,1.0,0.125\nm1_r3,2.0,0.5\n"
    )
    write_training_curves(training_curves(folder), results)
    lines = (results / "training.csv").read_text().splitlines()
    assert lines[1:] == ["m1_r3,1.0,0.125", "m1_r3,2.0,0.5", "m1_r4,30.5,0.25"]
    (results / "training.csv").write_text("training,epochs\nm1_r3,1.0\n")
    with pytest.raises(ValueError, match=r"training\.csv is no training\.csv"):
        write_training_curves(training_curves(folder), results)


def test_a_training_that_does_not_say_how_long_an_epoch_is_is_named(train):
    folder = train("m1", {100: 0.5}, settings={"data.folds": 5})
    with pytest.raises(ValueError, match=r"m1/settings\.json does not say how many steps an epoch has"):
        training_curves(folder)


def test_no_curve_is_no_figure(tmp_path):
    with pytest.raises(ValueError, match="no training was validated"):
        write_training_curves({}, tmp_path)
