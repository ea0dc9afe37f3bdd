"""The one LightningDataModule, over generated shards or the track's own folders."""

from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from lightning import LightningDataModule
from sklearn.model_selection import StratifiedKFold
from torch.utils.data import DataLoader, Dataset
from tqdm import tqdm

from symshrec.benchmark.cloud import ALL_FAMILIES, ALL_SOLIDS, PERTURBATIONS, LabelledCloud
from symshrec.benchmark.official import OfficialFolder
from symshrec.benchmark.shards import ShardedSplit
from symshrec.benchmark.stream import CloudStream, GeneratedSplit
from symshrec.data.batch import Batch, SampledBatch
from symshrec.data.rounds import RoundSampler
from symshrec.data.samples import CachedSamples, drawn
from symshrec.data.settings import DataKind, DataSettings, SamplingKind, SamplingSettings
from symshrec.data.training import MappedDataset, SampledDataset, StreamedDataset, fits_memory, mapped_clouds
from symshrec.scans.folder import CloudFolder


def collate(items: Sequence[tuple[int, LabelledCloud, np.ndarray | None]]) -> Batch:
    """(position, cloud, sample indices) of B clouds → one Batch; points are laid end to end, never padded."""
    positions, clouds, samples = zip(*items, strict=True)
    points = [np.asarray(cloud.points, dtype=np.float32) for cloud in clouds]
    return Batch(
        points=torch.from_numpy(np.concatenate(points)),
        lengths=torch.tensor([len(each) for each in points]),
        truth=[cloud.planes for cloud in clouds],
        labels=[cloud.labels for cloud in clouds],
        positions=list(positions),
        ids=[cloud.id for cloud in clouds],
        names=[cloud.name for cloud in clouds],
        diagonals=torch.tensor([cloud.diagonal for cloud in clouds], dtype=torch.float64),
        samples=None if samples[0] is None else torch.from_numpy(np.stack(samples).astype(np.int64)),
    )


def as_it_is(batch: Any) -> SampledBatch:
    """What the loader makes of a batch that is one already."""
    return batch


class CloudDataset(Dataset):
    """The clouds at `positions` of a split, with their samples where there are any."""

    def __init__(self, split, positions: np.ndarray, samples: CachedSamples | None = None):
        self.split, self.positions, self.samples = split, positions, samples

    def __len__(self) -> int:
        return len(self.positions)

    def __getitem__(self, item: int) -> tuple[int, LabelledCloud, np.ndarray | None]:
        position = int(self.positions[item])
        return position, self.split[position], None if self.samples is None else self.samples[position]


class HeldDataset(Dataset):
    """Some clouds of a generated split with their samples, made once and held in memory."""

    def __init__(self, split: GeneratedSplit, positions: Iterable[int], sampling: SamplingSettings, seed: int):
        self.items = []
        for position in positions:
            cloud, samples = split[position], None
            if sampling.kind is not SamplingKind.none:
                samples = drawn([cloud.points], [position], sampling, seed)[0]
            self.items.append((position, cloud, samples))

    def __len__(self) -> int:
        return len(self.items)

    def __getitem__(self, item: int) -> tuple[int, LabelledCloud, np.ndarray | None]:
        return self.items[item]


def passing(split, keep: Mapping[str, Sequence[str] | None], limit: int | None = None) -> np.ndarray:
    """Positions of the clouds of a split, ascending, that have one of the labels in `keep`; the first `limit` of them.

    Args:
        split: with an array of labels (C,) for each key of `keep` whose value is not None.
    """
    kept = np.ones(len(split), dtype=bool)
    for attribute, wanted in keep.items():
        if wanted is not None:
            kept &= np.isin(getattr(split, attribute), list(wanted))
    return np.flatnonzero(kept)[:limit]


class SymmetryDataModule(LightningDataModule):
    """Train and validation (a fold of the training split), test and predict (the test split).

    Training needs samples, which it holds in memory, so that no step waits for the disk; in a mapped file where they
    are too many. A streamed training makes its clouds as they are needed, and holds those that validate.

    Args:
        settings: what is loaded and how.
        seed: of the folds, of random samples and of the order of the training clouds.
        train_batch_size, steps_per_round: of the training loader; see `RoundSampler`.

    Raises:
        ValueError: for an unknown label, or where the filters leave no cloud.
    """

    def __init__(
        self, settings: DataSettings, seed: int = 2023, train_batch_size: int = 64, steps_per_round: int = 500
    ):
        super().__init__()
        known = {"families": ALL_FAMILIES, "perturbations": PERTURBATIONS, "solids": ALL_SOLIDS}
        self.keep = {name: getattr(settings, name) for name in known}
        for name, wanted in self.keep.items():
            unknown = sorted(set(wanted or ()) - set(known[name]))
            if unknown:
                raise ValueError(f"data.{name} holds {unknown}; choose from {', '.join(known[name])}")
        self.settings, self.seed = settings, seed
        self.root, self.test_split = Path(settings.root), settings.test_split
        self.train_batch_size, self.steps_per_round = train_batch_size, steps_per_round
        self.datasets: dict[str, Dataset] = {}
        self._samples: dict[str, CachedSamples] = {}
        self._splits: dict[str, ShardedSplit | GeneratedSplit | OfficialFolder | CloudFolder] = {}

    def split(self, name: str):
        """The whole split `name`, opened once: ShardedSplit, OfficialFolder, or CloudFolder for training alone.

        Of a streamed training, the split `train` is a GeneratedSplit.

        Raises:
            ValueError: for a test on clouds without truth; and what those classes raise.
        """
        if name not in self._splits:
            if self.settings.stream and name == "train":
                self._splits[name] = GeneratedSplit(self.settings.benchmark, name)
            elif self.settings.kind is DataKind.shards:
                self._splits[name] = ShardedSplit(self.root, name, verify=self.settings.verify)
            elif self.settings.kind is DataKind.clouds:
                if name != "train":
                    raise ValueError(
                        f"data.kind=clouds has no split {name!r} with truth; it is there to train on alone"
                    )
                self._splits[name] = CloudFolder(self.root)
            else:
                self._splits[name] = OfficialFolder(self.root, subset=self.settings.subset, split=name)
        return self._splits[name]

    def positions(self, name: str) -> np.ndarray:
        """Positions of the split `name` that pass the filters, ascending."""
        positions = passing(self.split(name), self.keep, self.settings.limit)
        if not len(positions):
            wanted = ", ".join(f"{name}={list(value)}" for name, value in self.keep.items() if value is not None)
            raise ValueError(f"{self.root}, split {name}: no cloud is left by the filters ({wanted or 'none set'})")
        return positions

    def samples(self, name: str) -> CachedSamples | None:
        """Sample indices of the split `name`, drawn once; None where none are asked for."""
        return None if self.settings.sampling.kind is SamplingKind.none else self._drawn(name)

    def _drawn(self, name: str) -> CachedSamples:
        if name not in self._samples:
            split, folder = self.split(name), self.root / "samples" / name
            self._samples[name] = CachedSamples(split, self.settings.sampling, self.seed, folder, split.fingerprint)
        return self._samples[name]

    def prepare_data(self) -> None:
        """Write what is missing beside the split that the trainer is about to use, in one process."""
        if self.trainer is None or self.settings.sampling.kind is SamplingKind.none:
            return
        stage = self.trainer.state.fn
        name = "train" if stage in ("fit", "validate") else self.test_split
        if not (self.settings.stream and name == "train"):
            samples = self._drawn(name)
            if stage == "fit" and not self._in_memory():
                mapped_clouds(self.split(name), samples, self.settings.verify)

    def setup(self, stage: str | None = None) -> None:
        """Open, filter and fold the split that the stage needs."""
        if stage in ("fit", "validate", None):
            positions = self.positions("train")
            train, val = (positions[rows] for rows in self._fold(positions))
            if stage == "fit":
                self.datasets["train"] = self._training(train)
            self.datasets["val"] = self._validation(val[: self.settings.validation_clouds])
        if stage in ("test", "predict", None):
            name = self.test_split
            self.datasets["test"] = CloudDataset(self.split(name), self.positions(name), self.samples(name))

    def _training(self, positions: np.ndarray) -> Dataset:
        """The clouds to learn from: those at these positions, or a stream."""
        settings = self.settings
        if settings.sampling.kind is SamplingKind.none:
            raise ValueError("training needs sampled points; set data.sampling.kind=farthest")
        if settings.stream:
            chosen = partial(passing, keep=self.keep, limit=settings.limit)
            return StreamedDataset(CloudStream(settings.benchmark, "train", chosen), settings.sampling, self.seed)
        split, samples = self.split("train"), self._drawn("train")
        if self._in_memory():
            return SampledDataset(split, positions, samples)
        return MappedDataset(positions, *mapped_clouds(split, samples, settings.verify))

    def _validation(self, positions: np.ndarray) -> Dataset:
        """The clouds that validate; a stream's are made once and held."""
        if not self.settings.stream:
            return CloudDataset(self.split("train"), positions, self.samples("train"))
        shown = tqdm(positions.tolist(), unit="cloud", desc="validation clouds", leave=False)
        return HeldDataset(self.split("train"), shown, self.settings.sampling, self.seed)

    def _in_memory(self) -> bool:
        asked = self.settings.in_memory
        return fits_memory(self.training_clouds(), self.settings.sampling.points) if asked is None else asked

    def training_clouds(self) -> int:
        """How many clouds an epoch holds, without reading them: those of the training folds, or a stream's."""
        positions = self.positions("train")
        return len(positions) if self.settings.stream else len(self._fold(positions)[0])

    def _fold(self, positions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        split = self.split("train")
        strata = np.char.add(split.families[positions].astype(str), split.perturbations[positions].astype(str))
        if min(np.unique(strata, return_counts=True)[1]) < self.settings.folds:
            strata = np.zeros(len(positions), dtype=int)
        if len(positions) < self.settings.folds:
            raise ValueError(f"{len(positions)} training clouds cannot be split into {self.settings.folds} folds")
        folds = StratifiedKFold(self.settings.folds, shuffle=True, random_state=self.seed)
        return list(folds.split(positions, strata))[self.settings.fold]

    def _loader(self, name: str) -> DataLoader:
        return DataLoader(
            self.datasets[name],
            batch_size=self.settings.batch_size,
            num_workers=self.settings.workers,
            collate_fn=collate,
        )

    def train_dataloader(self) -> DataLoader:
        """Batches of one round, whose number Lightning gives to the sampler; a resumed round goes on where it was."""
        rank, processes, first = 0, 1, 0
        if self.trainer:
            rank, processes = self.trainer.global_rank, self.trainer.world_size
            first = self.trainer.fit_loop.total_batch_idx + 1
        stream, workers = self.settings.stream, self.settings.workers if self.settings.stream else 0
        sampler = RoundSampler(
            self.training_clouds(),
            self.train_batch_size,
            self.steps_per_round,
            self.seed,
            rank,
            processes,
            first,
            stream,
        )
        return DataLoader(
            self.datasets["train"],
            sampler=sampler,
            batch_size=None,
            num_workers=workers,
            persistent_workers=workers > 0,
            collate_fn=as_it_is,
        )

    def val_dataloader(self) -> DataLoader:
        return self._loader("val")

    def test_dataloader(self) -> DataLoader:
        return self._loader("test")

    def predict_dataloader(self) -> DataLoader:
        return self._loader("test")
