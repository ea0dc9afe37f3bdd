"""§3.3 M3 as a SymmetryMethod: nothing to train, on the CPU, in one process or several."""

from torch import Tensor

from symshrec.batch import Batch
from symshrec.methods.base import SymmetryMethod
from symshrec.methods.m3.detection import M3Settings, detect_planes
from symshrec.methods.pool import DetectionPool
from symshrec.planes import Planes


class M3(SymmetryMethod):
    """Diffusion-based symmetry detection.

    Args:
        neighbours ... separation_deg: see `M3Settings`.
        count_threshold: confidence from which on a plane counts as found, in the count accuracy.
        workers: processes for `detect_batch`; 0 and 1 work in this one. They start with the first batch and end with
            the run. A cloud's planes do not depend on their number.
        refine: whether point-to-plane refinement follows.

    Raises:
        ValueError: naming the argument that is out of its range.
    """

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
        super().__init__(count_threshold, refine)
        self.settings = M3Settings(
            neighbours, eigenpairs, mollify, laplacian_neighbours, time_factor, chamfer_limit, separation_deg
        )
        self.pool = DetectionPool(detect_planes, workers)

    def detect(self, points: Tensor) -> Planes:
        """The planes of one cloud (N, 3), computed in this process; see `detect_planes` for what it raises."""
        return detect_planes(points.detach().cpu().numpy(), self.settings)

    def detect_batch(self, batch: Batch) -> list[Planes]:
        """The planes of every cloud, in order.

        Raises:
            ValueError, RuntimeError: naming the cloud that failed.
        """
        return self.pool.detect(batch.names, [cloud.detach().cpu().numpy() for cloud in batch.clouds], self.settings)

    def teardown(self, stage: str) -> None:
        """End the worker processes; Lightning calls this at the end of a run."""
        self.pool.close()
