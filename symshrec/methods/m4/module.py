"""M4 as a SymmetryMethod: nothing to train, on the CPU in one process or several, or on a GPU."""

from torch import Tensor

from symshrec.data.batch import Batch
from symshrec.methods.base import SymmetryMethod
from symshrec.methods.m4.pipeline import detect_planes
from symshrec.methods.m4.settings import M4Settings
from symshrec.planes import Planes


class M4(SymmetryMethod):
    """Training-free detection."""

    name = "m4"
    Settings = M4Settings
    settings: M4Settings
    version = 5

    def detect(self, points: Tensor) -> Planes:
        """The planes of one cloud (N, 3), computed where the points lie; see `detect_planes` for what it raises."""
        return detect_planes(points, self.settings)

    def detect_batch(self, batch: Batch) -> list[Planes]:
        """The planes of every cloud, in order; errors as in `cloud_by_cloud`."""
        return self.cloud_by_cloud(detect_planes, batch, [self.settings] * len(batch))
