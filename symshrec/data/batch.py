"""What the datamodule hands to a method: clouds end to end with their truth, or samples of them to learn from."""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
import torch
from torch import Tensor

from symshrec.benchmark.cloud import Labels
from symshrec.geometry.rotations import rotation_matrices
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


@dataclass
class SampledBatch:
    """Equally many points of B clouds, with what is to be learnt.

    points (B, N, 3) float32. normals (B, K, 3): the true planes', zero beyond a cloud's own. counts (B,) int64: how
    many are its own; 0 where it has none or its truth is withheld. centres (B, 3): the mean of the points given with
    the true planes, zero where there are none.
    """

    points: Tensor
    normals: Tensor
    counts: Tensor
    centres: Tensor

    def __len__(self) -> int:
        return len(self.points)

    @classmethod
    def of(cls, points: Tensor, truth: Sequence[Planes | None]) -> "SampledBatch":
        """From the sampled points (B, N, 3) of clouds and their true planes."""
        known = [Planes.empty() if planes is None else planes for planes in truth]
        counts = np.array([len(planes) for planes in known])
        normals = np.zeros((len(known), max(1, counts.max(initial=0)), 3), np.float32)
        centres = np.zeros((len(known), 3), np.float32)
        for row, planes in enumerate(known):
            normals[row, : len(planes)] = planes.normals
            centres[row] = planes.points.mean(0) if len(planes) else 0.0
        arrays = (torch.from_numpy(each).to(points.device) for each in (normals, counts, centres))
        return cls(points, *arrays)

    def __getitem__(self, rows) -> "SampledBatch":
        """The clouds at `rows`, a tensor or list of indices."""
        return SampledBatch(*(getattr(self, field.name)[rows] for field in fields(self)))

    def to(self, device, non_blocking: bool = True) -> "SampledBatch":
        """The same on another device (Lightning calls this)."""
        return SampledBatch(
            *(getattr(self, field.name).to(device, non_blocking=non_blocking) for field in fields(self))
        )

    def turned(self) -> "SampledBatch":
        """Every cloud and its planes in a rotation of its own, uniform over SO(3)."""
        quaternions = torch.nn.functional.normalize(torch.randn(len(self), 4, device=self.points.device), dim=1)
        rotations = rotation_matrices(quaternions).transpose(1, 2)
        centres = (self.centres[:, None] @ rotations)[:, 0]
        return SampledBatch(self.points @ rotations, self.normals @ rotations, self.counts, centres)
