"""M4 as a SymmetryMethod: nothing to train, on the CPU in one process or several, or on a GPU."""

from torch import Tensor

from symshrec.data.batch import Batch
from symshrec.methods.base import SymmetryMethod
from symshrec.methods.m4.confidence import CALIBRATION
from symshrec.methods.m4.pipeline import M4Settings, detect_planes
from symshrec.planes import Planes


class M4(SymmetryMethod):
    """Training-free detection.

    Args:
        points ... calibration: see `M4Settings`.
        count_threshold, workers, refine: see `SymmetryMethod`.

    Raises:
        ValueError: naming the argument that is out of its range.
    """

    name = "m4"
    version = 1

    def __init__(
        self,
        points: int = 8192,
        neighbours: int = 12,
        directions: int = 1500,
        candidates: int = 28,
        separation_deg: float = 5.0,
        max_planes: int = 40,
        together: bool = True,
        rounds: int = 10,
        calibration: tuple[float, ...] = CALIBRATION,
        count_threshold: float = 0.5,
        workers: int = 0,
        refine: bool = False,
    ):
        super().__init__(count_threshold, workers, refine)
        self.settings = M4Settings(
            points=points,
            neighbours=neighbours,
            directions=directions,
            candidates=candidates,
            separation_deg=separation_deg,
            max_planes=max_planes,
            together=together,
            rounds=rounds,
            calibration=tuple(calibration),
        )

    def detect(self, points: Tensor) -> Planes:
        """The planes of one cloud (N, 3), computed where the points lie; see `detect_planes` for what it raises."""
        return detect_planes(points, self.settings)

    def detect_batch(self, batch: Batch) -> list[Planes]:
        """The planes of every cloud, in order; errors as in `cloud_by_cloud`."""
        return self.cloud_by_cloud(detect_planes, batch, [self.settings] * len(batch))
