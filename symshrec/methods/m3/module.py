"""§3.3 M3 as a SymmetryMethod: nothing to train, on the CPU, in one process or several."""

from torch import Tensor

from symshrec.data.batch import Batch
from symshrec.methods.base import SymmetryMethod
from symshrec.methods.m3.pipeline import detect_planes
from symshrec.methods.m3.settings import M3Settings
from symshrec.planes import Planes


class M3(SymmetryMethod):
    """Diffusion-based symmetry detection."""

    name = "m3"
    Settings = M3Settings
    settings: M3Settings
    version = 1

    def detect(self, points: Tensor) -> Planes:
        """The planes of one cloud (N, 3), computed in this process; see `detect_planes` for what it raises."""
        return detect_planes(points.detach().cpu().numpy(), self.settings)

    def detect_batch(self, batch: Batch) -> list[Planes]:
        """The planes of every cloud, in order; errors as in `cloud_by_cloud`."""
        return self.cloud_by_cloud(detect_planes, batch.to("cpu"), [self.settings] * len(batch))
