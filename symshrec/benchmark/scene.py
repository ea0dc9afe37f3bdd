"""§2.2 What a perturbation works on: points, their true planes, and the surface they were drawn from."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from symshrec.benchmark.surfaces import Surface
from symshrec.planes import Planes


@dataclass(frozen=True, eq=False)
class Scene:
    """A clean cloud where it lies.

    points (N, 3) float64, the perturbation's own to change. planes: the true ones. surface: what the points lie on;
    chart (N, C): where on it.
    """

    points: np.ndarray
    planes: Planes
    surface: Surface
    chart: np.ndarray

    @property
    def normals(self) -> np.ndarray:
        """The surface's unit normals (N, 3) at the points, of either sign."""
        return self.surface.normals(self.chart)

    @property
    def centre(self) -> np.ndarray:
        """The centre (3,) of the points' axis-aligned bounding box."""
        return (self.points.min(axis=0) + self.points.max(axis=0)) / 2

    @property
    def diagonal(self) -> float:
        """The length of that box's diagonal."""
        return float(np.linalg.norm(np.ptp(self.points, axis=0)))


class Perturbed(NamedTuple):
    """points (M, 3), the parameters drawn by name, and the planes that are true of what was made."""

    points: np.ndarray
    parameters: dict[str, float]
    planes: Planes
