"""The one LightningDataModule, over generated shards or the track's own folders."""

from collections.abc import Sequence
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
from symshrec.data.batch import Batch, SampledBatch
from symshrec.data.rounds import RoundSampler
from symshrec.data.samples import cached_samples
from symshrec.data.settings import DataKind, DataSettings, SamplingKind
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

    def __init__(self, split, positions: np.ndarray, samples: np.ndarray | None = None):
        self.split, self.positions, self.samples = split, positions, samples

    def __len__(self) -> int:
        return len(self.positions)

    def __getitem__(self, item: int) -> tuple[int, LabelledCloud, np.ndarray | None]:
        position = int(self.positions[item])
        return position, self.split[position], None if self.samples is None else self.samples[position]


class SampledDataset(Dataset):
    """The sampled points and true planes of the clouds at `positions` of a split, in memory: whole batches at once."""

    def __init__(self, split, positions: np.ndarray, samples: np.ndarray, progress: bool = True):
        points = np.empty((len(positions), samples.shape[1], 3), np.float32)
        truth = []
        shown = tqdm(positions, unit="cloud", desc="training clouds", disable=not progress, leave=False)
        for row, position in enumerate(shown):
            cloud = split[int(position)]
            points[row] = cloud.points[samples[position]]
            truth.append(cloud.planes)
        self.clouds = SampledBatch.of(torch.from_numpy(points), truth)

    def __len__(self) -> int:
        return len(self.clouds)

    def __getitem__(self, rows: list[int]) -> SampledBatch:
        return self.clouds[torch.tensor(rows)]


class SymmetryDataModule(LightningDataModule):
    """Train and validation (a fold of the training split), test and predict (the test split).

    Training needs samples, which it holds in memory, so that no step waits for the disk.

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
        self.datasets: dict[str, SampledDataset | CloudDataset] = {}
        self._splits: dict[str, ShardedSplit | OfficialFolder | CloudFolder] = {}

    def split(self, name: str):
        """The whole split `name`, opened once: ShardedSplit, OfficialFolder, or CloudFolder for training alone.

        Raises:
            ValueError: for a test on clouds without truth; and what those classes raise.
        """
        if name not in self._splits:
            if self.settings.kind is DataKind.shards:
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
        split = self.split(name)
        kept = np.ones(len(split), dtype=bool)
        for attribute, wanted in self.keep.items():
            if wanted is not None:
                kept &= np.isin(getattr(split, attribute), list(wanted))
        positions = np.flatnonzero(kept)[: self.settings.limit]
        if not len(positions):
            wanted = ", ".join(f"{name}={list(value)}" for name, value in self.keep.items() if value is not None)
            raise ValueError(f"{self.root}, split {name}: no cloud is left by the filters ({wanted or 'none set'})")
        return positions

    def samples(self, name: str) -> np.ndarray | None:
        """(C, points) sample indices of the split `name`, drawn once; None where none are asked for."""
        if self.settings.sampling.kind is SamplingKind.none:
            return None
        split, sampling = self.split(name), self.settings.sampling
        folder = self.root / "samples" / name
        return cached_samples(split, sampling.kind, sampling.points, self.seed, folder, split.fingerprint)

    def prepare_data(self) -> None:
        """Draw missing samples of the split the trainer is about to use, in one process."""
        if self.trainer is not None and self.settings.sampling.kind is not SamplingKind.none:
            self.samples("train" if self.trainer.state.fn in ("fit", "validate") else self.test_split)

    def setup(self, stage: str | None = None) -> None:
        """Open, filter and fold the split that the stage needs."""
        if stage in ("fit", "validate", None):
            split, positions, samples = self.split("train"), self.positions("train"), self.samples("train")
            train, val = self._fold(positions)
            if stage == "fit":
                self.datasets["train"] = SampledDataset(split, positions[train], self._needed(samples))
            self.datasets["val"] = CloudDataset(split, positions[val][: self.settings.validation_clouds], samples)
        if stage in ("test", "predict", None):
            name = self.test_split
            self.datasets["test"] = CloudDataset(self.split(name), self.positions(name), self.samples(name))

    def training_clouds(self) -> int:
        """How many clouds the training folds hold, without reading them."""
        return len(self._fold(self.positions("train"))[0])

    def _needed(self, samples: np.ndarray | None) -> np.ndarray:
        if samples is None:
            raise ValueError("training needs sampled points; set data.sampling.kind=farthest")
        return samples

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
        clouds = self.datasets["train"]
        sampler = RoundSampler(
            len(clouds), self.train_batch_size, self.steps_per_round, self.seed, rank, processes, first
        )
        return DataLoader(clouds, sampler=sampler, batch_size=None, collate_fn=as_it_is)

    def val_dataloader(self) -> DataLoader:
        return self._loader("val")

    def test_dataloader(self) -> DataLoader:
        return self._loader("test")

    def predict_dataloader(self) -> DataLoader:
        return self._loader("test")
