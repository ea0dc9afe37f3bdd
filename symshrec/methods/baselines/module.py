"""The baselines as SymmetryMethods: nothing to train, on the CPU, in one process or several."""

from collections.abc import Callable

from torch import Tensor

from symshrec.data.batch import Batch
from symshrec.methods.base import SymmetryMethod
from symshrec.methods.baselines import pca_icp, ransac
from symshrec.methods.baselines.settings import PcaIcpSettings, RansacSettings
from symshrec.planes import Planes


class Baseline(SymmetryMethod):
    """A function of points and settings as a method."""

    find: Callable[..., Planes]  # of points (N, 3) and settings, as `Find` of the pool

    def detect(self, points: Tensor) -> Planes:
        """The planes of one cloud (N, 3), computed in this process; the baseline's own function says what it raises."""
        return type(self).find(points.detach().cpu().numpy(), self.settings)

    def detect_batch(self, batch: Batch) -> list[Planes]:
        """The planes of every cloud, in order; errors as in `cloud_by_cloud`."""
        return self.cloud_by_cloud(type(self).find, batch.to("cpu"), [self.settings] * len(batch))


class PcaIcp(Baseline):
    """The three planes across the principal axes, polished with ICP."""

    name = "pca_icp"
    Settings = PcaIcpSettings
    version = 1
    find = staticmethod(pca_icp.detect_planes)


class Ransac(Baseline):
    """Bisectors of random point pairs, polished with ICP."""

    name = "ransac"
    Settings = RansacSettings
    version = 1
    find = staticmethod(ransac.detect_planes)
