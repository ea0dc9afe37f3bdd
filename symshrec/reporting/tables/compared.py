"""What finished runs predicted, beside the truth of the same clouds."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from symshrec.benchmark.cloud import Labels
from symshrec.files.predictions import load_metadata, load_predictions
from symshrec.planes import PackedPlanes


@dataclass(frozen=True, eq=False)
class Compared:
    """One run's predictions and the truth of the same C clouds, in order; diagonals (C,), labels of length C."""

    name: str
    predicted: PackedPlanes
    truth: PackedPlanes
    diagonals: np.ndarray
    labels: Sequence[Labels]


def compare_runs(paths: Mapping[str, Path], split) -> dict[str, Compared]:
    """The predictions files of runs over one split, with the truth, which is read once.

    Args:
        paths: of files that evaluations left, by the runs' folders.
        split: the split they were made on, ShardedSplit or OfficialFolder.

    Raises:
        PredictionFileError: for a file that is missing or damaged.
        ValueError: naming a file that was predicted on other data, or on other clouds than the first.
    """
    compared, first = {}, None
    for run, path in paths.items():
        predictions, metadata = load_predictions(path), load_metadata(path)
        if metadata.get("data") != split.fingerprint:
            raise ValueError(f"{path} was predicted on other data than {split.root} holds; evaluate that run again")
        if first is None:
            first, truth = predictions.positions, _truth(split, predictions.positions)
        if not np.array_equal(predictions.positions, first):
            raise ValueError(
                f"{path} is of other clouds than {next(iter(paths.values()))}; evaluate both on all clouds"
            )
        compared[run] = Compared(metadata["method"], predictions.planes, *truth)
    return compared


def _truth(split, positions: np.ndarray) -> tuple[PackedPlanes, np.ndarray, tuple[Labels, ...]]:
    clouds = (split[position] for position in positions.tolist())
    planes, diagonals, labels = zip(*((each.planes, each.diagonal, each.labels) for each in clouds), strict=True)
    return PackedPlanes.pack(planes), np.array(diagonals), labels
