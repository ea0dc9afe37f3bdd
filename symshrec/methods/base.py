"""What every method is: a LightningModule that turns clouds into planes, with the only test step there is."""

from abc import abstractmethod
from collections.abc import Callable, Mapping, MutableMapping, Sequence

from lightning import LightningModule
from torch import Tensor

from symshrec.data.batch import Batch
from symshrec.files.pool import DetectionPool, Find, detect_named
from symshrec.methods.fit import refined
from symshrec.methods.settings import MethodSettings
from symshrec.metrics.torchmetric import SymmetryMetric
from symshrec.planes import Planes


class SymmetryMethod(LightningModule):
    """A detector of mirror planes (section 3).

    A method states its `name`, its `Settings` and its `version`, and implements `detect`, and `detect_batch` where it
    gains from seeing many clouds at once. It knows nothing of how clouds are made or stored.

    Args:
        settings: an instance of the class's `Settings`; None takes its defaults.

    Attributes:
        Settings: the frozen dataclass of its settings.
        version: raised whenever the planes change that the same settings give. Stored runs are known by it. Of a method
            that states none, they are known by its source code.
        oracle: whether it is given the true planes: tables show it as a limit to hold the others against, and never as
            the best of them.
        shelf: where runs over the same clouds that differ in a few settings leave for each other what does not depend
            on these, by position of the cloud; None where there is no such other run.
    """

    name: str
    Settings: type[MethodSettings] = MethodSettings
    version: int | None = None
    oracle = False

    def __init__(self, settings: MethodSettings | None = None):
        super().__init__()
        self.settings = self.Settings() if settings is None else settings
        if not isinstance(self.settings, self.Settings):
            raise TypeError(f"{type(self).__name__} takes {self.Settings.__name__}, not {type(settings).__name__}")
        self.pool = DetectionPool(self.settings.workers)
        self.test_metric: SymmetryMetric | None = None
        self.known: Mapping[int, Planes] = {}
        self.detected: Mapping[int, Planes] = {}
        self.shelf: MutableMapping | None = None

    @property
    def count_threshold(self) -> float:
        """Planes of at least this confidence count as found."""
        return self.settings.count_threshold

    @property
    def refine(self) -> bool:
        """Whether refinement follows detection (see `refine_planes`)."""
        return self.settings.refine

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
        assert self.test_metric is not None  # since `on_test_start`
        planes = _filled(batch, self.known, self.planes_of)
        self.test_metric.update(planes, batch.truth, batch.diagonals, batch.labels, batch.positions)
        return planes


def _filled(batch: Batch, known: Mapping[int, Planes], work: Callable[[Batch], list[Planes]]) -> list[Planes]:
    """Planes of every cloud of a batch: those `known` by position, and of the rest what `work` finds."""
    missing = [row for row, position in enumerate(batch.positions) if position not in known]
    found = dict(zip(missing, work(batch.select(missing)) if missing else (), strict=True))
    return [found[row] if row in found else known[at] for row, at in enumerate(batch.positions)]
