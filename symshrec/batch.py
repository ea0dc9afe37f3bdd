"""What the datamodule hands to a method: a ragged batch of clouds with their truth."""

from dataclasses import dataclass

import torch
from torch import Tensor

from symshrec.benchmark.cloud import Labels
from symshrec.planes import Planes


@dataclass
class Batch:
    """B clouds end to end, so that no padding can be mistaken for a point.

    points (ΣN, 3) float32: the clouds in order; lengths (B,) int64.
    truth: true planes per cloud, None where withheld.
    positions: places in the split, unique, by which predictions are stored; ids and names as on disk.
    diagonals (B,) float64: of the full clouds' bounding boxes.
    samples (B, n) int64 or None: indices of the sampled points into each cloud, where data.sampling asks for them.
    """

    points: Tensor
    lengths: Tensor
    truth: list[Planes | None]
    labels: list[Labels]
    positions: list[int]
    ids: list[int]
    names: list[str]
    diagonals: Tensor
    samples: Tensor | None = None

    def __len__(self) -> int:
        return len(self.lengths)

    @property
    def clouds(self) -> list[Tensor]:
        """Views of the single clouds, each (N, 3)."""
        return list(torch.split(self.points, self.lengths.tolist()))

    @property
    def sampled(self) -> Tensor:
        """The sampled points of every cloud, (B, n, 3).

        Raises:
            ValueError: where the datamodule was not asked to sample.
        """
        if self.samples is None:
            raise ValueError("this batch holds no samples; set data.sampling.points to the number a method needs")
        starts = self.lengths.cumsum(0) - self.lengths
        return self.points[starts[:, None] + self.samples]

    def select(self, rows: list[int]) -> "Batch":
        """The batch of these clouds alone, in the order given."""
        clouds = self.clouds
        return Batch(
            points=torch.cat([clouds[row] for row in rows]),
            lengths=self.lengths[rows],
            truth=[self.truth[row] for row in rows],
            labels=[self.labels[row] for row in rows],
            positions=[self.positions[row] for row in rows],
            ids=[self.ids[row] for row in rows],
            names=[self.names[row] for row in rows],
            diagonals=self.diagonals[rows],
            samples=None if self.samples is None else self.samples[rows],
        )

    def to(self, device) -> "Batch":
        """Move the tensors (Lightning calls this); planes and labels stay with the host."""
        for name in ("points", "lengths", "diagonals", "samples"):
            value = getattr(self, name)
            if value is not None:
                setattr(self, name, value.to(device, non_blocking=True))
        return self
