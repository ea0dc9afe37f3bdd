"""§3.1 M1 as the paper words it, cloud by cloud in single precision, without the shortcuts of `methods.m1`."""

from typing import Any

import numpy as np
import torch
import torch.nn.functional as F
from scipy.optimize import linear_sum_assignment
from sklearn.cluster import DBSCAN
from torch import Tensor, nn

from symshrec.planes import Planes


class PlainPCT(nn.Module):
    """The network of R3 and R4: the global feature is joined to every point's, attention is normalised as written.

    Args:
        network: an M1Network with PCT, whose weights are taken over.
    """

    inner: Any  # an nn.Module, with its parts by name

    def __init__(self, network: nn.Module):
        super().__init__()
        self.inner = network

    def forward(self, cloud: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """One cloud (N, 3) on the unit sphere → normals (N, M, 3), logits (N, M), centres (N, 3)."""
        inner, count = self.inner, len(cloud)
        encoder = inner.encoder
        x, outputs = cloud, []
        for layer in encoder.embed:
            x = self._layer(layer, x)
        for attention in encoder.attention:
            query = attention.query(x)
            weights = torch.softmax(query @ query.T, dim=-1)
            weights = weights / (1e-9 + weights.sum(dim=0, keepdim=True))
            x = x + self._layer(attention.transform, x - weights.T @ attention.value(x))
            outputs.append(x)
        features = self._layer(encoder.fuse, torch.cat(outputs, dim=1))
        scores = self._layer(inner.pooling.score[0], features)
        weights = torch.softmax(inner.pooling.score[1](scores), dim=0)
        pooled = (weights * features).sum(dim=0)
        joined = torch.cat([features, pooled.expand(count, -1)], dim=1)
        matrix = torch.cat([inner.of_point.weight, inner.of_cloud.weight], dim=1)
        hidden = torch.relu(inner.norm(joined @ matrix.T)).chunk(3, dim=1)
        said = [
            output(self._layer(head, part))
            for head, output, part in zip(inner.heads, inner.outputs, hidden, strict=True)
        ]
        return F.normalize(said[0].view(count, -1, 3), dim=-1), said[1], said[2]

    @staticmethod
    def _layer(layer: Any, x: Tensor) -> Tensor:
        return torch.relu(layer.norm(layer.linear(x)))


def plain_loss(said: tuple[Tensor, Tensor, Tensor], normals: Tensor, centre: Tensor) -> Tensor:
    """Eq. 1 of one cloud with true unit normals (K, 3) and a point on all planes (3,)."""
    predicted, logits, centres = said
    sines = 1 - torch.einsum("nmi,ki->nmk", predicted, normals) ** 2
    heads, planes = linear_sum_assignment(sines.mean(dim=0).detach().numpy())
    labels = torch.zeros_like(logits)
    labels[:, heads] = 1
    vector = sines[:, heads, planes].mean()
    return F.binary_cross_entropy_with_logits(logits, labels) + vector + (centres - centre).norm(dim=1).mean()


def plain_decode(
    normals: np.ndarray, confidences: np.ndarray, centres: np.ndarray, confidence=0.3, eps_deg=3.0, min_share=0.1,
    agreement_deg=1.0,
    separation_deg=5.0,
) -> Planes:  # fmt: skip
    """Planes from all predictions of one cloud, (N, M, 3), (N, M) and (N, 3), by scikit-learn's DBSCAN on all N · M.

    The arguments are those of `symshrec.methods.m1.settings.DecodeSettings`.
    """
    count = len(normals)
    normals, confidences = normals.reshape(-1, 3), confidences.reshape(-1)
    distances = 1 - np.abs(normals @ normals.T)
    clusters = DBSCAN(
        eps=1 - np.cos(np.deg2rad(eps_deg)), min_samples=round(min_share * count), metric="precomputed"
    ).fit(distances.clip(0))
    found = []
    for label in range(clusters.labels_.max() + 1):
        members = (clusters.labels_ == label) & (confidences >= confidence)
        if members.any():
            moment = (confidences[members, None] * normals[members]).T @ normals[members]
            axis = np.linalg.eigh(moment)[1][:, -1]
            sines = np.linalg.norm(np.cross(normals[members], axis), axis=1)
            weights = np.exp(-((sines / np.deg2rad(agreement_deg)) ** 2) / 2)
            found.append((min(1.0, (confidences[members] * weights).sum() / count), axis))
    kept: list[tuple[float, np.ndarray]] = []
    for support, axis in sorted(found, key=lambda each: -each[0]):
        if all(abs(axis @ other) <= np.cos(np.deg2rad(separation_deg)) for _, other in kept):
            kept.append((support, axis))
    if not kept:
        return Planes.empty()
    axes = np.stack([axis for _, axis in kept])
    return Planes(axes, np.tile(centres.mean(axis=0), (len(kept), 1)), np.array([support for support, _ in kept]))
