"""§3.3 M3 as a SymmetryMethod: nothing to train, on the CPU, in one process or several."""

from torch import Tensor

from symshrec.data.batch import Batch
from symshrec.methods.base import SymmetryMethod
from symshrec.methods.m3.pipeline import M3Settings, detect_planes
from symshrec.planes import Planes


class M3(SymmetryMethod):
    """Diffusion-based symmetry detection.

    Args:
        neighbours ... separation_deg: see `M3Settings`.
        count_threshold, workers, refine: see `SymmetryMethod`.

    Raises:
        ValueError: naming the argument that is out of its range.
    """

    name = "m3"
    version = 1

    def __init__(
        self,
        neighbours: int = 200,
        eigenpairs: int = 10,
        mollify: float = 1e-3,
        laplacian_neighbours: int = 30,
        time_factor: float = 0.3,
        chamfer_limit: float = 100.0,
        separation_deg: float = 5.0,
        count_threshold: float = 0.95,
        workers: int = 0,
        refine: bool = False,
    ):
        super().__init__(count_threshold, workers, refine)
        self.settings = M3Settings(
            neighbours, eigenpairs, mollify, laplacian_neighbours, time_factor, chamfer_limit, separation_deg
        )

    def detect(self, points: Tensor) -> Planes:
        """The planes of one cloud (N, 3), computed in this process; see `detect_planes` for what it raises."""
        return detect_planes(points.detach().cpu().numpy(), self.settings)

    def detect_batch(self, batch: Batch) -> list[Planes]:
        """The planes of every cloud, in order; errors as in `cloud_by_cloud`."""
        return self.cloud_by_cloud(detect_planes, batch.to("cpu"), [self.settings] * len(batch))
