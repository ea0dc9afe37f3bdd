"""What `symshrec.detect` asks of a method, and M3 and M4 without Lightning, whose import takes longer than they do."""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Any, Protocol

from torch import Tensor

from symshrec.planes import Planes

SETTINGS = {"m3": "M3Settings", "m4": "M4Settings"}  # of `detect_planes`, beside it in the method's detection.py
ARRAYS = ("m3",)  # work on arrays, wherever the points lie


class Detector(Protocol):
    """What finds planes; every SymmetryMethod does. count_threshold, refine: as there."""

    count_threshold: float
    refine: bool

    def detect(self, points: Tensor) -> Planes:
        """The mirror planes of one cloud (N, 3), in its own coordinates and in any order.

        Raises:
            ValueError: for points that cannot be used.
        """


@dataclass(frozen=True)
class TrainingFree:
    """A method with nothing to train: a function of points (N, 3), a tensor or an array, and of its settings."""

    find: Callable[[Any, Any], Planes]
    settings: Any
    count_threshold: float
    refine: bool
    arrays: bool

    def detect(self, points: Tensor) -> Planes:
        """`find(points, settings)`, which says what it raises."""
        return self.find(points.detach().cpu().numpy() if self.arrays else points, self.settings)


def training_free(name: str, count_threshold: float, refine: bool, **settings) -> TrainingFree:
    """The method of SETTINGS with this name.

    Raises:
        ValueError: naming the setting that is out of its range.
    """
    home = import_module(f"symshrec.methods.{name}.pipeline")
    chosen = getattr(home, SETTINGS[name])(**settings)
    return TrainingFree(home.detect_planes, chosen, count_threshold, refine, name in ARRAYS)
