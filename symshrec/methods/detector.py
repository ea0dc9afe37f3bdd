"""What `symshrec.detect` asks of a method, and M3 and M4 without Lightning, whose import takes longer than they do."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

from torch import Tensor

from symshrec.methods.registry import detect_planes_of, method_class
from symshrec.methods.settings import MethodSettings
from symshrec.planes import Planes

ARRAYS = ("m3",)  # work on arrays, wherever the points lie


class Detector(Protocol):
    """What finds planes; every SymmetryMethod does. count_threshold, refine: as there."""

    @property
    def count_threshold(self) -> float: ...

    @property
    def refine(self) -> bool: ...

    def detect(self, points: Tensor) -> Planes:
        """The mirror planes of one cloud (N, 3), in its own coordinates and in any order.

        Raises:
            ValueError: for points that cannot be used.
        """


@dataclass(frozen=True)
class TrainingFree:
    """A method with nothing to train: a function of points (N, 3), a tensor or an array, and of its settings."""

    find: Callable[[Any, Any], Planes]
    settings: MethodSettings

    @property
    def count_threshold(self) -> float:
        """The method's own."""
        return self.settings.count_threshold

    @property
    def refine(self) -> bool:
        """Whether refinement follows."""
        return self.settings.refine

    def detect(self, points: Tensor) -> Planes:
        """`find(points, settings)`, which says what it raises."""
        arrays = self.settings.name in ARRAYS
        return self.find(points.detach().cpu().numpy() if arrays else points, self.settings)


def made(name: str, settings: MethodSettings) -> Detector:
    """The method of this name with these settings, without Lightning where it does without.

    Raises:
        ValueError: for weights that cannot be used, or as `registry.method_class`.
    """
    find = detect_planes_of(name)
    return method_class(name)(settings) if find is None else TrainingFree(find, settings)
