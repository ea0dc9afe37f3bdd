"""§3.1 M1 as a SymmetryMethod that learns: farthest points on the unit sphere, the network, the decoding."""

from collections.abc import Sequence

import torch
from torch import Tensor, nn

from symshrec.data.batch import SampledBatch
from symshrec.geometry.unit_sphere import UnitSphere
from symshrec.methods.learned import LearnedMethod
from symshrec.methods.m1.decode import decode
from symshrec.methods.m1.loss import m1_losses
from symshrec.methods.m1.network import M1Network
from symshrec.methods.m1.settings import DecodeSettings, LossSettings, NetworkSettings
from symshrec.planes import Planes

MIRROR = (1.0, -1.0, 1.0)


class M1(LearnedMethod):
    """Dense symmetry prediction with a Point Cloud Transformer or a PointNet.

    Args:
        network, loss, decode: see `NetworkSettings`, `LossSettings` and `DecodeSettings`. Weights bring the network
            they belong to.
        twice: let the network also see every cloud mirrored in y, whose planes are the mirrored ones. The track's
            shapes and poses are as likely one way as the other, and its errors are not the same.
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
        twice: bool = False,
        weights: Sequence[str] = (),
        count_threshold: float = 0.5,
        workers: int = 0,
        refine: bool = False,
    ):
        super().__init__(weights, count_threshold, workers, refine)
        self.loss, self.decode, self.twice = loss or LossSettings(), decode or DecodeSettings(), twice
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
        """The planes of clouds (B, N, 3); what several networks say, or one of both views, is clustered together."""
        frame = UnitSphere.of(points)
        views = [torch.ones(3)] + [torch.tensor(MIRROR)] * self.twice
        said = [self._said(frame.apply(points), network, view) for network in self.networks for view in views]
        # a point's predictions side by side, so that the first points stay the first
        together = [torch.stack(each, 2).flatten(1, 2).double().cpu().numpy() for each in zip(*said, strict=True)]
        return frame.restored([decode(*cloud, self.decode) for cloud in zip(*together, strict=True)])

    @staticmethod
    def _said(points: Tensor, network: M1Network, view: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Normals (B, N, M, 3), confidences (B, N, M) and centres (B, N, 3), seen with the axes' signs of `view`."""
        view = view.to(points)
        dense = network(points * view)
        return dense.normals * view, dense.logits.sigmoid(), dense.centres * view
