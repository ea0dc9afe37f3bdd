"""Not in the paper: the true planes as a method, so that refinement after it shows what estimation alone loses."""

import numpy as np
from torch import Tensor

from symshrec.data.batch import Batch
from symshrec.methods.base import SymmetryMethod
from symshrec.planes import Planes


class Truth(SymmetryMethod):
    """An oracle: the true planes with confidence 1, as a search without a mistake would find them.

    Each is a little off, one way or another by chance: refinement keeps a plane that fits better than all it finds, as
    the exact one often does, and has to find these from the points. Refined, they are what the estimator loses even
    when the search is perfect. With both errors 0 and no refinement, the score is 1 everywhere.

    Args:
        angle_deg: by which every plane is turned about the foot of the cloud's centroid, in [0, 90].
        offset: by which it is moved along its normal, a share of the cloud's diagonal.
        count_threshold, workers, refine: see `SymmetryMethod`.

    Raises:
        ValueError: naming the argument that is out of its range.
    """

    name = "truth"
    version = 1
    oracle = True

    def __init__(
        self,
        angle_deg: float = 0.3,
        offset: float = 0.003,
        count_threshold: float = 0.5,
        workers: int = 0,
        refine: bool = True,
    ):
        super().__init__(count_threshold, workers, refine)
        for name, value, most in (("angle_deg", angle_deg, 90), ("offset", offset, np.inf)):
            if not 0 <= value <= most:
                raise ValueError(f"{name} is {value}, expected a number in [0, {most:g}]")
        self.angle_deg, self.offset = angle_deg, offset

    def detect(self, points: Tensor) -> Planes:
        """Refuse: points alone do not tell their true planes.

        Raises:
            ValueError: always.
        """
        raise ValueError("method truth gives labelled clouds their own planes; on points alone choose another method")

    def detect_batch(self, batch: Batch) -> list[Planes]:
        """The planes of every cloud, in order, always the same for a cloud's position in its split.

        Raises:
            ValueError: naming a cloud whose truth is withheld.
        """
        for name, planes in zip(batch.names, batch.truth, strict=True):
            if planes is None:
                raise ValueError(f"cloud {name} has no true planes; method truth needs labelled clouds")
        centroids = [cloud.double().mean(0).cpu().numpy() for cloud in batch.clouds]
        distances = self.offset * batch.diagonals.cpu().numpy()
        return [
            displaced(planes, centre, np.deg2rad(self.angle_deg), distance, np.random.default_rng(position))
            for planes, centre, distance, position in zip(
                batch.truth, centroids, distances, batch.positions, strict=True
            )
        ]


def displaced(planes: Planes, centre: np.ndarray, angle: float, distance: float, rng: np.random.Generator) -> Planes:
    """Every plane turned by an angle about the foot of `centre` (3,), and moved along its normal; confidences 1."""
    normals = planes.normals
    feet = centre - (normals @ centre - planes.offsets)[:, None] * normals
    sideways = np.cross(normals, rng.normal(size=normals.shape))
    sideways /= np.linalg.norm(sideways, axis=1, keepdims=True)
    ways = rng.choice([-1.0, 1.0], (len(planes), 1))
    return Planes(np.cos(angle) * normals + np.sin(angle) * sideways, feet + ways * distance * normals)
