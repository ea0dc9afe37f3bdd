"""What every method is: a LightningModule that turns clouds into planes, with the only test step there is."""

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence

from lightning import LightningModule
from torch import Tensor

from symshrec.data.batch import Batch
from symshrec.files.pool import DetectionPool, Find, detect_named
from symshrec.methods.fit import refined
from symshrec.metrics.torchmetric import SymmetryMetric
from symshrec.planes import Planes


class SymmetryMethod(LightningModule):
    """A detector of mirror planes (section 3).

    A method implements `detect`, and `detect_batch` where it gains from seeing many clouds at once. It knows nothing of
    how clouds are made or stored. One that is told the true planes says so with `oracle`: tables show it as a limit to
    hold the others against, and never as the best of them.

    A class states its `name` and a `version`, which counts up whenever its planes change: stored predictions of another
    version are not taken for its own. A class that states none is known by its source instead.

    Args:
        count_threshold: planes of at least this confidence count as found in the count accuracy.
        workers: processes for what is done cloud by cloud on the CPU; 0 and 1 work in this one. They start with the
            first batch and end with the run. The planes do not depend on their number.
        refine: whether refinement follows detection (see `refine_planes`).
    """

    name: str
    version: int | None = None
    oracle = False

    def __init__(self, count_threshold: float = 0.5, workers: int = 0, refine: bool = False):
        super().__init__()
        self.count_threshold, self.refine = count_threshold, refine
        self.pool = DetectionPool(workers)
        self.test_metric: SymmetryMetric | None = None
        self.known: Mapping[int, Planes] = {}
        self.detected: Mapping[int, Planes] = {}

    @abstractmethod
    def detect(self, points: Tensor) -> Planes:
        """The mirror planes of one cloud.

        Args:
            points: (N, 3), any position and scale.

        Returns:
            Planes in the cloud's own coordinates, in any order; none is a valid answer.

        Raises:
            ValueError: for a wrong shape or values that are not finite.
        """

    def detect_batch(self, batch: Batch) -> list[Planes]:
        """The planes of every cloud of a batch, in order."""
        return [self.detect(points) for points in batch.clouds]

    def cloud_by_cloud(self, find: Find, batch: Batch, others: Sequence) -> list[Planes]:
        """find(cloud, other) for every cloud of a batch and its other argument: on the pool, or where the batch lies.

        Raises:
            ValueError, RuntimeError: naming the cloud that failed.
        """
        if batch.points.device.type == "cpu":
            return self.pool.map(find, batch.names, [cloud.detach().numpy() for cloud in batch.clouds], others)
        jobs = zip(batch.names, batch.clouds, others, strict=True)
        return [detect_named(find, *job) for job in jobs]

    def planes_of(self, batch: Batch) -> list[Planes]:
        """What the method answers for every cloud of a batch: its planes, refined where asked.

        Planes `detected` by position in an earlier run without refinement are taken from there.
        """
        found = _filled(batch, self.detected, self.detect_batch)
        if not self.refine:
            return found
        return self.cloud_by_cloud(refined, batch, found)

    def measure_at(self, thetas_deg: Sequence[float], epsilons: Sequence[float]) -> None:
        """Choose the tolerances of the coming test: angles in degrees, distances as a share of the diagonal (§2.3)."""
        self.test_metric = SymmetryMetric(thetas_deg, epsilons, self.count_threshold)

    def predict_step(self, batch: Batch, batch_idx: int) -> list[Planes]:
        return self.planes_of(batch)

    def teardown(self, stage: str) -> None:
        """End the worker processes; Lightning calls this at the end of a run, also after an error."""
        self.pool.close()

    def on_test_start(self) -> None:
        if self.test_metric is None:
            self.measure_at([1.0], [0.01])

    def test_step(self, batch: Batch, batch_idx: int) -> list[Planes]:
        """Detect and score; planes that are `known` by position from an earlier, unfinished run are taken as they are.

        Returns:
            The planes of every cloud, for callbacks to store and show.
        """
        planes = _filled(batch, self.known, self.planes_of)
        self.test_metric.update(planes, batch.truth, batch.diagonals, batch.labels, batch.positions)
        return planes


def _filled(batch: Batch, known: Mapping[int, Planes], work: Callable[[Batch], list[Planes]]) -> list[Planes]:
    """Planes of every cloud of a batch: those `known` by position, and of the rest what `work` finds."""
    missing = [row for row, position in enumerate(batch.positions) if position not in known]
    found = dict(zip(missing, work(batch.select(missing)) if missing else (), strict=True))
    return [found[row] if row in found else known[at] for row, at in enumerate(batch.positions)]
