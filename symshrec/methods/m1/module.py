"""§3.1 M1 as a SymmetryMethod that learns: farthest points on the unit sphere, the network, the decoding."""

from collections.abc import Sequence

import torch
from torch import Tensor, nn

from symshrec.batch import SampledBatch
from symshrec.methods.learned import LearnedMethod, UnitSphere
from symshrec.methods.m1.decode import decode
from symshrec.methods.m1.loss import m1_losses
from symshrec.methods.m1.network import M1Network
from symshrec.methods.m1.settings import DecodeSettings, LossSettings, NetworkSettings
from symshrec.planes import Planes


class M1(LearnedMethod):
    """Dense symmetry prediction with a Point Cloud Transformer or a PointNet.

    Args:
        network, loss, decode: see `NetworkSettings`, `LossSettings` and `DecodeSettings`. Weights bring the network
            they belong to.
        weights, count_threshold, workers, refine: see `LearnedMethod`.

    Raises:
        ValueError: naming the setting that is out of its range. WeightsError: for weights that cannot be used.
    """

    name = "m1"

    def __init__(
        self,
        network: NetworkSettings | None = None,
        loss: LossSettings | None = None,
        decode: DecodeSettings | None = None,
        weights: Sequence[str] = (),
        count_threshold: float = 0.5,
        workers: int = 0,
        refine: bool = False,
    ):
        super().__init__(weights, count_threshold, workers, refine)
        self.loss, self.decode = loss or LossSettings(), decode or DecodeSettings()
        self.networks = self.build(network or NetworkSettings())

    def network_of(self, settings: NetworkSettings) -> nn.Module:
        return M1Network(settings)

    def losses(self, batch: SampledBatch) -> dict[str, Tensor]:
        """Eq. 1 and its terms; see `m1_losses`."""
        frame = UnitSphere.of(batch.points)
        count, rows = batch.points.shape[1], None
        if self.loss.head_points is not None and self.loss.head_points < count:
            rows = torch.randperm(count, device=batch.points.device)[: self.loss.head_points]
        points = frame.apply(batch.points)
        dense = self.networks[0](points, rows)
        seen = points if rows is None else points[:, rows]
        return m1_losses(dense, seen, batch.normals, batch.counts, frame.apply(batch.centres), self.loss)

    def detect_sampled(self, points: Tensor) -> list[Planes]:
        """The planes of clouds (B, N, 3) of N sampled points; several networks' predictions are clustered together."""
        frame = UnitSphere.of(points)
        said = [network(frame.apply(points)) for network in self.networks]
        normals = torch.stack([each.normals for each in said], 2).flatten(1, 2)  # a point's predictions side by side
        confidences = torch.stack([each.logits.sigmoid() for each in said], 2).flatten(1, 2)
        centres = torch.stack([each.centres for each in said], 2).flatten(1, 2)
        arrays = [each.double().cpu().numpy() for each in (normals, confidences, centres)]
        return frame.restored([decode(*cloud, self.decode) for cloud in zip(*arrays, strict=True)])
