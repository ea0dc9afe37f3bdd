"""What a command is pointed at: clouds with their truth, and results, from whatever kind of file they are in."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from symshrec.benchmark.cloud import LabelledCloud, Labels
from symshrec.benchmark.manifest import MANIFEST, REQUEST
from symshrec.benchmark.official import OfficialFolder, ResultsFolder, chosen_ids
from symshrec.benchmark.shards import ShardedSplit
from symshrec.files.predictions import load_metadata, load_predictions
from symshrec.planes import Planes


class Clouds(Protocol):
    """A split, opened: ShardedSplit or OfficialFolder."""

    def __len__(self) -> int: ...

    def __getitem__(self, position: int) -> LabelledCloud: ...

    def labels(self, position: int) -> Labels:
        """What is known of the cloud at a position without reading its points."""


class Results(Protocol):
    """A method's planes by cloud ID: ResultsFolder or PredictedResults."""

    ids: Sequence[int]

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
        threshold = load_metadata(path).get("count_threshold")
        self.count_threshold = None if threshold is None else float(threshold)

    def get(self, cloud: int) -> Planes | None:
        """The planes of a cloud, by its ID; None where it is not in the file."""
        return self.planes[self._places[cloud]] if cloud in self._places else None


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
