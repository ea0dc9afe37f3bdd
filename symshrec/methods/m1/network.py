"""§3.1, figure 3: point-wise features (PointNet or PCT), spatially weighted pooling, three dense heads."""

from itertools import pairwise
from typing import NamedTuple

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from symshrec.methods.m1.settings import Encoder, NetworkSettings


class Dense(NamedTuple):
    """What every point says: vectors (B, S, M, 3) of any length, logits of confidence (B, S, M), centres (B, S, 3)."""

    vectors: Tensor
    logits: Tensor
    centres: Tensor

    @property
    def normals(self) -> Tensor:
        """(B, S, M, 3) of length one."""
        return F.normalize(self.vectors, dim=-1)


class PointLayer(nn.Module):
    """The same linear map for every point, batch normalisation, ReLU: (B, N, inward) → (B, N, outward)."""

    def __init__(self, inward: int, outward: int):
        super().__init__()
        self.linear = nn.Linear(inward, outward, bias=False)
        self.norm = nn.BatchNorm1d(outward)

    def forward(self, x: Tensor) -> Tensor:
        y = self.linear(x)
        return F.relu(self.norm(y.flatten(0, 1))).view_as(y)


class OffsetAttention(nn.Module):
    """Offset attention of the Point Cloud Transformer (Guo et al. 2021, Eq. 4–7): (B, N, C) → (B, N, C).

    Queries and keys share one projection. The weights are a softmax over one axis, then divided by their sums over the
    other; that division is left until after the product with the values, which spares a pass over (B, N, N).
    """

    def __init__(self, channels: int):
        super().__init__()
        self.query = nn.Linear(channels, channels // 4, bias=False)
        self.value = nn.Linear(channels, channels)
        self.transform = PointLayer(channels, channels)

    def forward(self, x: Tensor) -> Tensor:
        query = self.query(x)  # (B, N, C/4)
        weights = (query @ query.transpose(1, 2)).softmax(-1)  # (B, N, N)
        values = self.value(x)
        values = torch.cat([values, torch.ones_like(values[..., :1])], -1)  # (B, N, C + 1): the last one sums weights
        attended = weights.transpose(1, 2) @ values
        attended = attended[..., :-1] / (attended[..., -1:] + 1e-9)
        return x + self.transform(x - attended)


class PCT(nn.Module):
    """Point Cloud Transformer without its downsampling, since every point predicts: (B, N, 3) → (B, N, features)."""

    def __init__(self, channels: int, layers: int, features: int):
        super().__init__()
        self.embed = nn.Sequential(PointLayer(3, 64), PointLayer(64, channels))
        self.attention = nn.ModuleList(OffsetAttention(channels) for _ in range(layers))
        self.fuse = PointLayer(layers * channels, features)

    def forward(self, points: Tensor) -> Tensor:
        x, outputs = self.embed(points), []
        for layer in self.attention:
            x = layer(x)
            outputs.append(x)
        return self.fuse(torch.cat(outputs, -1))


class PointNet(nn.Module):
    """PointNet's shared layers (Qi et al. 2017), 3 → 64 → 128 → 512 → features: (B, N, 3) → (B, N, features)."""

    def __init__(self, features: int):
        super().__init__()
        widths = (3, 64, 128, 512, features)
        self.layers = nn.Sequential(*(PointLayer(*pair) for pair in pairwise(widths)))

    def forward(self, points: Tensor) -> Tensor:
        return self.layers(points)


class SpatialPooling(nn.Module):
    """Mean over points, weighted by a softmax of each point's own score: (B, N, F) → (B, F)."""

    def __init__(self, features: int):
        super().__init__()
        self.score = nn.Sequential(PointLayer(features, 64), nn.Linear(64, 1))

    def forward(self, features: Tensor) -> Tensor:
        return (self.score(features).softmax(1) * features).sum(1)


class M1Network(nn.Module):
    """Clouds on the unit sphere → what every point predicts."""

    def __init__(self, settings: NetworkSettings):
        super().__init__()
        features, (first, second), planes = settings.features, settings.hidden, settings.planes
        if settings.encoder is Encoder.pct:
            self.encoder: nn.Module = PCT(settings.channels, settings.layers, features)
        else:
            self.encoder = PointNet(features)
        self.pooling = SpatialPooling(features)
        # The heads' first layers side by side, over [point feature, global feature]: the global half once a cloud.
        self.of_point = nn.Linear(features, 3 * first, bias=False)
        self.of_cloud = nn.Linear(features, 3 * first, bias=False)
        self.norm = nn.BatchNorm1d(3 * first)
        self.heads = nn.ModuleList(PointLayer(first, second) for _ in range(3))
        self.outputs = nn.ModuleList(nn.Linear(second, outputs) for outputs in (3 * planes, planes, 3))
        self.settings = settings

    def forward(self, points: Tensor, rows: Tensor | None = None) -> Dense:
        """Predictions of the points (B, N, 3) at `rows` (S,), of all where there are none given."""
        features = self.encoder(points)
        pooled = self.pooling(features)
        if rows is not None:
            features = features[:, rows]
        hidden = self.of_point(features) + self.of_cloud(pooled)[:, None]
        hidden = F.relu(self.norm(hidden.flatten(0, 1))).view_as(hidden)
        parts = [head(part) for head, part in zip(self.heads, hidden.chunk(3, dim=-1), strict=True)]
        with torch.autocast(points.device.type, enabled=False):  # bfloat16 would round normals by a tenth of a degree
            vectors, logits, centres = (output(part.float()) for output, part in zip(self.outputs, parts, strict=True))
        return Dense(vectors.unflatten(-1, (self.settings.planes, 3)), logits, centres)
