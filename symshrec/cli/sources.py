"""What a command is pointed at: clouds with their truth, and results, from whatever kind of file they are in."""

import math
import sys
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from symshrec.benchmark.cloud import LabelledCloud, Labels
from symshrec.benchmark.manifest import MANIFEST, REQUEST
from symshrec.benchmark.official import (
    ConfidenceWarning,
    OfficialFolder,
    ResultsFolder,
    chosen_ids,
    warn_of_confidences,
)
from symshrec.benchmark.shards import ShardedSplit
from symshrec.files.predictions import PredictionFileError, load_metadata, load_predictions
from symshrec.planes import Planes


class Clouds(Protocol):
    """A split, opened: ShardedSplit or OfficialFolder."""

    def __len__(self) -> int: ...

    def __getitem__(self, position: int) -> LabelledCloud: ...

    def labels(self, position: int) -> Labels:
        """What is known of the cloud at a position without reading its points."""


class Results(Protocol):
    """A method's planes by cloud ID: ResultsFolder or PredictedResults."""

    @property
    def ids(self) -> Sequence[int]:
        """Of the clouds that have results, ascending."""

    def get(self, cloud: int) -> Planes | None:
        """The planes of a cloud, None where it has none."""


@dataclass(frozen=True)
class Truth:
    """The clouds to score against: `clouds` at `positions` (C,), whose IDs are `ids` (C,); `known`: IDs of all."""

    clouds: Clouds
    positions: np.ndarray
    ids: np.ndarray
    known: np.ndarray


class PredictedResults:
    """The planes of one of our predictions files, by cloud ID.

    count_threshold: the confidence from which the method meant its planes to count, None where the file does not say.

    Warns:
        ConfidenceWarning: where confidences are outside [0, 1].

    Raises:
        PredictionFileError: for a file that is missing, damaged or in another format.
        ValueError: where two clouds in it have one ID.
    """

    def __init__(self, path: Path):
        predictions = load_predictions(path)
        self.planes = predictions.planes
        self._places = {cloud: place for place, cloud in enumerate(predictions.ids.tolist())}
        if len(self._places) < len(predictions.ids):
            ids, counts = np.unique(predictions.ids, return_counts=True)
            raise ValueError(f"{path}: ID {ids[counts.argmax()]} is of several clouds; predict one split at a time")
        self.ids = sorted(self._places)
        warn_of_confidences(self.planes.confidences, path)
        self.count_threshold = _threshold(load_metadata(path).get("count_threshold"), path)

    def get(self, cloud: int) -> Planes | None:
        """The planes of a cloud, by its ID; None where it is not in the file."""
        return self.planes[self._places[cloud]] if cloud in self._places else None


def _threshold(text: str | None, path: Path) -> float | None:
    if text is None:
        return None
    with suppress(ValueError):
        if not math.isnan(float(text)):
            return float(text)
    raise PredictionFileError(f"{path}: its count_threshold is {text[:40]!r}, which is no number; predict again")


@contextmanager
def warnings_as_lines(command: str) -> Iterator[None]:
    """What is warned of within goes to stderr as the command's own lines, each once."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("once", ConfidenceWarning)
        yield
    for text in dict.fromkeys(str(each.message) for each in caught):
        print(f"symshrec {command}: {text}", file=sys.stderr)


def holds_shards(root: Path) -> bool:
    """Whether a folder is one of ours, its generation finished or not."""
    return (root / MANIFEST).exists() or (root / REQUEST).exists()


def open_truth(root: Path, split: str | None, subset: Path | None, points: Path | None) -> Truth:
    """Open shards or an official folder, narrowed to the IDs of a subset list.

    Args:
        split: as `OfficialFolder`; of shards, "test" where None.

    Raises:
        ValueError: where the truth is withheld, and for `points` beside shards, which hold their own.
        OfficialFileError, ShardError: as `OfficialFolder` and `ShardedSplit`.
    """
    clouds: ShardedSplit | OfficialFolder
    if holds_shards(root):
        if points is not None:
            raise ValueError(f"{root} holds shards, and those their points; leave out --points")
        clouds = ShardedSplit(root, split or "test")
        known = np.arange(len(clouds))
    else:
        clouds = OfficialFolder(root, split=split, points=points)
        known = clouds.ids
        if not clouds.has_truth:
            raise ValueError(f"{clouds.root} holds no truth to score against, no *_sym.txt file")
    ids = known if subset is None else np.array(chosen_ids(known.tolist(), subset, root), dtype=np.int64)
    return Truth(clouds, np.searchsorted(known, ids), ids, known)


def open_results(path: Path) -> Results:
    """Open a folder of `points<ID>_res.txt` or one of our predictions files; errors as theirs."""
    return PredictedResults(path) if path.is_file() else ResultsFolder(path)
