"""The order in which training clouds come: endless epochs cut into rounds, each known from its number alone."""

from collections.abc import Iterator

import numpy as np
from torch.utils.data import Sampler


class RoundSampler(Sampler[list[int]]):
    """Indices of the batches of one round.

    Every epoch is a permutation of the clouds drawn from (seed, epoch), cut into batches; what does not fill one is
    left to the next epoch's chance. Rounds are stretches of `steps` batches of that endless row, so a run that is
    resumed sees what it would have seen.

    Args:
        clouds: of an epoch.
        batch_size: clouds of a batch, on each process.
        steps: batches of a round.
        seed: of the permutations.
        rank, processes: every process takes each `processes`-th batch, from its rank on.
        first: batch of the endless row that this process begins with; what comes before it is left out of its round.
        endless: whether every epoch has clouds of its own: the indices of epoch e are those from e · clouds on.

    Raises:
        ValueError: where the clouds do not fill one batch for each process.
    """

    def __init__(
        self,
        clouds: int,
        batch_size: int,
        steps: int,
        seed: int,
        rank: int = 0,
        processes: int = 1,
        first: int = 0,
        endless: bool = False,
    ):
        if clouds < batch_size * processes:
            raise ValueError(
                f"{clouds} training clouds do not fill {processes} batch(es) of {batch_size}; lower train.batch_size"
            )
        self.clouds, self.batch_size, self.steps, self.seed = clouds, batch_size, steps, seed
        self.rank, self.processes, self.first, self.round = rank, processes, first, 0
        self.endless = endless

    @property
    def epoch_steps(self) -> int:
        """Batches that a process takes in an epoch."""
        return self.clouds // (self.batch_size * self.processes)

    def set_epoch(self, epoch: int) -> None:
        """Choose the round; Lightning calls its rounds epochs."""
        self.round = epoch

    def __len__(self) -> int:
        return self.steps

    def __iter__(self) -> Iterator[list[int]]:
        drawn = None
        for step in range(max(self.first, self.round * self.steps), (self.round + 1) * self.steps):
            epoch, place = divmod(step, self.epoch_steps)
            if epoch != drawn:
                drawn = epoch
                order = np.random.default_rng(np.random.SeedSequence((self.seed, epoch))).permutation(self.clouds)
                order += epoch * self.clouds if self.endless else 0
            start = (place * self.processes + self.rank) * self.batch_size
            yield order[start : start + self.batch_size].tolist()
