"""§3.1.1 Validation mAP over the epochs of trainings, out of their TensorBoard files: a figure and its numbers."""

import csv
import json
import logging
from collections.abc import Mapping, Sequence
from itertools import cycle
from pathlib import Path

from matplotlib.figure import Figure

from symshrec.files.atomic import write_atomically
from symshrec.reporting.figures.figures import COLOURS, save_figure
from symshrec.reporting.tables.documents import csv_text

EVENTS, SETTINGS, RECORD, TAG = "tensorboard", "settings.json", "training.json", "val/mAP"
COOLDOWN = "/cooldown_"  # in the name of a branch, whose learning rate falls to zero
COLUMNS = ("training", "epochs", "validation_mAP")
Curve = list[tuple[float, float]]


def training_curves(folder: Path) -> dict[str, Curve]:
    """(epochs, validation mAP) of every training below a folder that was validated, by its path in there.

    The epochs of a finished training count on from those of the weights that it started from.

    Args:
        folder: runs/<data>/training. A training may still be going on.

    Raises:
        ValueError: for a training whose settings.json is damaged or does not say how long an epoch is, or whose record
            is damaged.
    """
    curves = {}
    for place in sorted(events.parent for events in Path(folder).rglob(EVENTS)):
        values = _validations(place / EVENTS)
        if values and (place / SETTINGS).exists():
            steps, before = steps_per_epoch(place / SETTINGS), _epochs_before(place / RECORD)
            curve = [(before + step / steps, value) for step, value in values.items()]
            curves[place.relative_to(folder).as_posix()] = curve
    return curves


def steps_per_epoch(path: Path) -> float:
    """Optimiser steps that a pass over the training folds takes, by a training's settings; errors name the file."""
    try:
        settings = json.loads(path.read_text(encoding="utf-8"))
        folds = settings["data.folds"]
        clouds = settings["data.limit"] or settings["data.benchmark.splits.train.clouds"]
        devices = settings["trainer.devices"] * settings.get("trainer.num_nodes", 1)
        return clouds * (folds - 1) / folds / (settings["train.batch_size"] * devices)
    except (ValueError, KeyError, TypeError, ZeroDivisionError) as error:
        raise ValueError(f"{path} does not say how many steps an epoch has ({error!r})") from error


def write_training_curves(curves: Mapping[str, Curve], folder: Path) -> list[Path]:
    """Write training.png and training.csv; returns both.

    Trainings that an earlier training.csv there knows and that are not among the curves, since another machine had
    them, keep their lines.

    Raises:
        ValueError: where there is no curve, or for a training.csv that is none.
    """
    if not curves:
        raise ValueError("no training was validated; one leaves runs/<data>/training/<name>/tensorboard")
    figure, numbers = Path(folder) / "training.png", Path(folder) / "training.csv"
    curves = dict(sorted((_published(numbers) | dict(curves)).items()))
    rows = [(name, round(epochs, 4), round(value, 6)) for name, curve in curves.items() for epochs, value in curve]
    save_figure(training_figure(curves), figure)
    write_atomically(numbers, csv_text(COLUMNS, rows).encode())
    return [figure, numbers]


def training_figure(curves: Mapping[str, Curve]) -> Figure:
    """A line for every training; a cool-down as a cross in the colour of the training that it branched off."""
    figure = Figure(figsize=(8.2, 4.6), layout="constrained")
    ax = figure.subplots()
    colours = dict(zip(dict.fromkeys(name.partition(COOLDOWN)[0] for name in curves), cycle(COLOURS), strict=False))
    for name, curve in curves.items():
        trunk, branch, _ = name.partition(COOLDOWN)
        if branch:
            epochs, value = curve[-1]
            ax.plot(epochs, value, "x", color=colours[trunk], markersize=9, label=f"{trunk}, cooled down: {value:.3f}")
        else:
            last = curve[-1][1]
            ax.plot(*_columns(curve), "-o", color=colours[trunk], markersize=3, label=f"{trunk}: {last:.3f}")
    ax.set(xlabel="epochs", ylabel="validation mAP at θ = 1°, ε = 1%", ylim=(None, 1.0))
    ax.set_xlim(left=0)
    ax.grid(color="#dddddd", linewidth=0.6)
    ax.legend(loc="lower right", fontsize=9, frameon=False)
    return figure


def _epochs_before(record: Path) -> float:
    """Epochs behind the weights that a training started from; 0 where it has no record yet."""
    if not record.exists():
        return 0.0
    try:
        return float(json.loads(record.read_text(encoding="utf-8")).get("before", {}).get("epochs", 0.0))
    except (ValueError, AttributeError, TypeError) as error:
        raise ValueError(f"{record} is damaged ({error}); remove it, and the same training writes it again") from error


def _published(numbers: Path) -> dict[str, Curve]:
    """The curves of a training.csv; none where it does not exist."""
    if not numbers.exists():
        return {}
    curves: dict[str, Curve] = {}
    try:
        with open(numbers, newline="", encoding="utf-8") as file:
            for row in csv.DictReader(file):
                name, epochs, value = (row[column] for column in COLUMNS)
                curves.setdefault(name, []).append((float(epochs), float(value)))
    except (ValueError, KeyError, TypeError) as error:
        raise ValueError(f"{numbers} is no training.csv ({error!r}); put it right or remove it") from error
    return curves


def _columns(curve: Curve) -> Sequence[Sequence[float]]:
    return tuple(zip(*curve, strict=True))


def _validations(events: Path) -> dict[int, float]:
    """Validation mAP by optimiser step, ascending; of a step that was done twice, after a kill, the later one."""
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    logging.getLogger("tensorboard").setLevel(logging.WARNING)  # it names every file that it opens
    accumulator = EventAccumulator(str(events), size_guidance={"scalars": 0, "images": 1, "tensors": 1})
    accumulator.Reload()
    if TAG not in accumulator.Tags()["scalars"]:
        return {}
    found = {
        event.step: event.value for event in accumulator.Scalars(TAG) if event.step
    }  # up to 0.2.0 the last came at 0, too
    return dict(sorted(found.items()))
