"""§3.2 The heads: each maps the global feature to the four numbers of one plane."""

import math

import torch
from torch import Tensor, nn
from torch.nn import functional

from symshrec.geometry.hemisphere import hemisphere_directions

SHORTEST_NORMAL = 1e-6


class PlaneHeads(nn.Module):
    """H heads of three linear layers with ReLU, batch normalisation and dropout, computed side by side.

    Args:
        features: length of the global feature.
        heads: H.
        hidden: width of the two layers between.
        dropout: share of hidden values left out in training.
        spread: whether the heads start near planes through the origin whose normals are spread over the hemisphere.
            Not in the paper; the usual start gives planes by chance, with offsets as large as the cloud.

    Raises:
        ValueError: naming the argument that is out of its range.
    """

    def __init__(self, features: int, heads: int = 27, hidden: int = 256, dropout: float = 0.1, spread: bool = True):
        super().__init__()
        for name, value in (("features", features), ("heads", heads), ("hidden", hidden)):
            if value < 1:
                raise ValueError(f"{name} is {value}, expected at least 1")
        if not 0 <= dropout < 1:
            raise ValueError(f"dropout is {dropout}, expected a share in [0, 1)")
        self.heads, self.dropout = heads, dropout
        self.first = HeadwiseLinear(heads, features, hidden)
        self.second = HeadwiseLinear(heads, hidden, hidden)
        self.third = HeadwiseLinear(heads, hidden, 4)
        self.first_norm, self.second_norm = (nn.BatchNorm1d(heads * hidden) for _ in range(2))
        if spread:
            with torch.no_grad():
                self.third.bias.copy_(functional.pad(torch.from_numpy(hemisphere_directions(heads)).float(), (0, 1)))

    def forward(self, features: Tensor) -> tuple[Tensor, Tensor]:
        """Planes n·x + d = 0 from global features (B, F): unit normals (B, H, 3) and offsets d (B, H), in float32."""
        hidden = self._activated(self.first_norm, self.first(features[:, None]))
        hidden = self._activated(self.second_norm, self.second(hidden))
        with torch.autocast(features.device.type, enabled=False):  # bfloat16 would round normals by a tenth of a degree
            return unit_planes(self.third(hidden.float()))

    def _activated(self, norm: nn.BatchNorm1d, hidden: Tensor) -> Tensor:
        hidden = norm(hidden.flatten(1)).unflatten(1, (self.heads, -1))
        return functional.dropout(functional.relu(hidden), self.dropout, self.training)


class HeadwiseLinear(nn.Module):
    """A linear layer for each head: (B, H, in), or (B, 1, in) shared by all, → (B, H, out)."""

    def __init__(self, heads: int, incoming: int, outgoing: int):
        super().__init__()
        bound = 1 / math.sqrt(incoming)
        self.weight = nn.Parameter(torch.empty(heads, outgoing, incoming).uniform_(-bound, bound))
        self.bias = nn.Parameter(torch.empty(heads, outgoing).uniform_(-bound, bound))

    def forward(self, values: Tensor) -> Tensor:
        if values.shape[1] == 1:
            return functional.linear(values[:, 0], self.weight.flatten(0, 1)).unflatten(1, self.bias.shape) + self.bias
        return torch.bmm(values.transpose(0, 1), self.weight.mT).transpose(0, 1) + self.bias


def unit_planes(raw: Tensor) -> tuple[Tensor, Tensor]:
    """The planes of raw (..., 4) numbers (n, d), divided by ‖n‖: unit normals (..., 3) and offsets (...).

    Where ‖n‖ is below `SHORTEST_NORMAL` there is no direction: the plane is z = 0, without gradient.
    """
    lengths = torch.linalg.vector_norm(raw[..., :3].detach(), dim=-1, keepdim=True)
    fallback = torch.tensor([0.0, 0.0, 1.0, 0.0], dtype=raw.dtype, device=raw.device)
    raw = torch.where(lengths < SHORTEST_NORMAL, fallback, raw)
    planes = raw / torch.linalg.vector_norm(raw[..., :3], dim=-1, keepdim=True)
    return planes[..., :3], planes[..., 3]
