"""§3.2 M2 as a SymmetryMethod that learns: farthest points on the unit sphere, planes of all heads, cleaning."""

from dataclasses import replace

import numpy as np
import torch
from torch import Tensor, nn

from symshrec.data.batch import SampledBatch
from symshrec.geometry.unit_sphere import UnitSphere
from symshrec.methods.learned import LearnedMethod
from symshrec.methods.m2.chamfer import mirrored_chamfer
from symshrec.methods.m2.cleaning import clean, confidences
from symshrec.methods.m2.loss import symmetry_loss
from symshrec.methods.m2.network import M2Network
from symshrec.methods.m2.settings import Confidence, M2Settings, NetworkSettings
from symshrec.methods.weights import Weights, load_into, read_weights
from symshrec.planes import Planes

ENCODER = "encoder."
PRETRAINED = "m2_pretrain"  # the method that weights of a pre-training name


class M2(LearnedMethod):
    """The Multi-Head Symmetry Transformer, which learns without labels.

    The planes of several networks are cleaned together.
    """

    name = "m2"
    Settings = M2Settings
    settings: M2Settings
    version = 1

    def network_of(self, settings: NetworkSettings) -> nn.Module:
        return M2Network(settings)

    def start_from(self, name: str) -> Weights:
        """The encoder of a pre-training alone, or all of an earlier training."""
        weights, (network, *_) = read_weights(name, self.name, "m2", PRETRAINED), self.networks
        if weights.method == self.name:
            load_into(network, weights)
            return weights
        tensors = {key: value for key, value in weights.tensors.items() if key.startswith(ENCODER)}
        tensors = {key.removeprefix(ENCODER): value for key, value in tensors.items()}
        load_into(network.encoder, replace(weights, tensors=tensors))
        return weights

    def losses(self, batch: SampledBatch) -> dict[str, Tensor]:
        """The published loss and its terms, the regularisation before its weight; see `symmetry_loss`."""
        points = UnitSphere.of(batch.points).apply(batch.points)
        count, queries = points.shape[1], None
        if self.training and self.settings.loss.queries is not None and self.settings.loss.queries < count:
            queries = torch.randperm(count, device=points.device)[: self.settings.loss.queries]
        found = symmetry_loss(points, *self.networks[0](points), self.settings.loss.regularisation, queries)
        return {"symmetry": found.symmetry, "regularisation": found.regularisation, "loss": found.total}

    def detect_sampled(self, points: Tensor) -> list[Planes]:
        """The planes of clouds (B, N, 3) of N sampled points: by ascending loss, or, without confidences, by head.

        Scoring takes equal confidences in the order given; the loss must not tell them apart by the back door.
        """
        frame = UnitSphere.of(points)
        seen = frame.apply(points)
        said = [network(seen) for network in self.networks]
        normals, offsets = (torch.cat(each, 1) for each in zip(*said, strict=True))
        losses = mirrored_chamfer(seen, normals, offsets)
        arrays = [each.double().cpu().numpy() for each in (normals, offsets, losses)]
        return frame.restored([self._cleaned(*cloud) for cloud in zip(*arrays, strict=True)])

    def _cleaned(self, normals, offsets, losses) -> Planes:
        """The planes that cleaning leaves of one cloud, on the sphere, from arrays (H, 3), (H,) and (H,)."""
        cleaning = replace(self.settings.cleaning, loss_limit=self.settings.cleaning.limit_at(self.points))
        kept = clean(normals, losses, cleaning)
        if self.settings.confidence is Confidence.none:
            kept = np.sort(kept)
        sure = confidences(losses[kept], self.settings.confidence, cleaning.loss_limit)
        return Planes(normals[kept], -offsets[kept, None] * normals[kept], sure)
