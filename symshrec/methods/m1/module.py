"""§3.1 M1 as a SymmetryMethod that learns: farthest points on the unit sphere, the network, the decoding."""

import torch
from torch import Tensor, nn

from symshrec.data.batch import SampledBatch
from symshrec.geometry.unit_sphere import UnitSphere
from symshrec.methods.learned import LearnedMethod
from symshrec.methods.m1.decode import decode
from symshrec.methods.m1.loss import m1_losses
from symshrec.methods.m1.network import M1Network
from symshrec.methods.m1.settings import M1Settings, NetworkSettings
from symshrec.planes import Planes

MIRROR = (1.0, -1.0, 1.0)


class M1(LearnedMethod):
    """Dense symmetry prediction with a Point Cloud Transformer or a PointNet."""

    name = "m1"
    Settings = M1Settings
    settings: M1Settings
    DETECTION = ("decode", "twice")
    version = 1

    def network_of(self, settings: NetworkSettings) -> nn.Module:
        return M1Network(settings)

    def losses(self, batch: SampledBatch) -> dict[str, Tensor]:
        """Eq. 1 and its terms; see `m1_losses`."""
        frame = UnitSphere.of(batch.points)
        count, rows = batch.points.shape[1], None
        if self.settings.loss.head_points is not None and self.settings.loss.head_points < count:
            rows = torch.randperm(count, device=batch.points.device)[: self.settings.loss.head_points]
        points = frame.apply(batch.points)
        dense = self.networks[0](points, rows)
        seen = points if rows is None else points[:, rows]
        return m1_losses(dense, seen, batch.normals, batch.counts, frame.apply(batch.centres), self.settings.loss)

    def detect_sampled(self, points: Tensor) -> list[Planes]:
        """The planes of clouds (B, N, 3); what several networks say, or one of both views, is clustered together."""
        frame = UnitSphere.of(points)
        views = [torch.ones(3)] + [torch.tensor(MIRROR)] * bool(self.settings.twice)
        said = [self._said(frame.apply(points), network, view) for network in self.networks for view in views]
        # a point's predictions side by side, so that the first points stay the first
        together = [torch.stack(each, 2).flatten(1, 2).double().cpu().numpy() for each in zip(*said, strict=True)]
        return frame.restored([decode(*cloud, self.settings.decode) for cloud in zip(*together, strict=True)])

    @staticmethod
    def _said(points: Tensor, network: M1Network, view: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Normals (B, N, M, 3), confidences (B, N, M) and centres (B, N, 3), seen with the axes' signs of `view`."""
        view = view.to(points)
        dense = network(points * view)
        return dense.normals * view, dense.logits.sigmoid(), dense.centres * view
