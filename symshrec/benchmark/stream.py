"""§2.1–2.2 Clouds without a disk: a split whose clouds are made when they are asked for, and endless further ones."""

import hashlib
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from symshrec.benchmark.balance import split_labels
from symshrec.benchmark.cloud import ALL_FAMILIES, PERTURBATIONS, LabelledCloud
from symshrec.benchmark.config import BenchmarkConfig, check_config
from symshrec.benchmark.generate import generate_cloud
from symshrec.benchmark.manifest import json_text
from symshrec.benchmark.tasks import request_of


class GeneratedSplit:
    """The clouds of one split by position, each made anew when it is asked for; the same as a `ShardedSplit` reads.

    Raises:
        ValueError: for a config that cannot be, or without this split.
    """

    def __init__(self, config: BenchmarkConfig, split: str):
        check_config(config)
        self.config, self.split = config, split
        self._labels = split_labels(config, split)

    def __len__(self) -> int:
        return len(self._labels)

    def __getitem__(self, index: int) -> LabelledCloud:
        """The cloud at `index`. Raises IndexError outside the split."""
        return generate_cloud(self.config, self.split, int(index))

    @property
    def families(self) -> np.ndarray:
        """Family of every cloud, (C,) of str."""
        return np.array(ALL_FAMILIES)[self._labels.families]

    @property
    def perturbations(self) -> np.ndarray:
        """Perturbation of every cloud, (C,) of str."""
        return np.array(PERTURBATIONS)[self._labels.perturbations]

    @property
    def fingerprint(self) -> str:
        """Changes when the clouds do: sha256 of all that decides them."""
        return hashlib.sha256(json_text(request_of(self.config)).encode()).hexdigest()


class CloudStream:
    """Clouds without end, as those of one split and none of them: every epoch is a split of its own, as large.

    Cloud n is made from the config, the split's name and n alone, in whatever order and in whatever process.

    Args:
        config: of the benchmark. split: whose size and counts each epoch has.
        chosen: positions of a split's clouds that count, equally many in each epoch; all where it is None. A function
            of a module, or a partial one, where other processes are to draw clouds.

    Raises:
        ValueError: as GeneratedSplit.
    """

    def __init__(
        self, config: BenchmarkConfig, split: str, chosen: Callable[[GeneratedSplit], np.ndarray] | None = None
    ):
        self.config, self.split, self.chosen = config, split, chosen
        self._epoch, self._clouds, self._positions = -1, GeneratedSplit(config, split), np.empty(0, np.int64)
        self._open(0)
        self.epoch_clouds = len(self._positions)

    def __getitem__(self, number: int) -> LabelledCloud:
        """Cloud `number` of the stream, 0 or more."""
        epoch, place = divmod(int(number), self.epoch_clouds)
        self._open(epoch)
        return self._clouds[self._positions[place]]

    def _open(self, epoch: int) -> None:
        if epoch == self._epoch:
            return
        name = f"{self.split}_stream_{epoch}"
        self._clouds = GeneratedSplit(replace(self.config, splits={name: self.config.splits[self.split]}), name)
        self._positions = np.arange(len(self._clouds)) if self.chosen is None else self.chosen(self._clouds)
        self._epoch = epoch
