"""Not in the paper: the true planes as a method, so that refinement after it shows what estimation alone loses."""

import numpy as np
from torch import Tensor

from symshrec.data.batch import Batch
from symshrec.methods.base import SymmetryMethod
from symshrec.methods.oracle.settings import OracleSettings
from symshrec.planes import Planes


class Oracle(SymmetryMethod):
    """The true planes with confidence 1, as a search without a mistake would find them.

    Each is a little off, one way or another by chance: refinement keeps a plane that fits better than all it finds, as
    the exact one often does, and has to find these from the points. Refined, they are what the estimator loses even
    when the search is perfect. With both errors 0 and no refinement, the score is 1 everywhere.
    """

    name = "oracle"
    Settings = OracleSettings
    settings: OracleSettings
    version = 1
    oracle = True

    def detect(self, points: Tensor) -> Planes:
        """Refuse: points alone do not tell their true planes.

        Raises:
            ValueError: always.
        """
        raise ValueError("method oracle gives labelled clouds their own planes; on points alone choose another method")

    def detect_batch(self, batch: Batch) -> list[Planes]:
        """The planes of every cloud, in order, always the same for a cloud's position in its split.

        Raises:
            ValueError: naming a cloud whose truth is withheld.
        """
        for name, planes in zip(batch.names, batch.truth, strict=True):
            if planes is None:
                raise ValueError(f"cloud {name} has no true planes; method oracle needs labelled clouds")
        centroids = [cloud.double().mean(0).cpu().numpy() for cloud in batch.clouds]
        distances = self.settings.offset * batch.diagonals.cpu().numpy()
        return [
            displaced(planes, centre, np.deg2rad(self.settings.angle_deg), distance, np.random.default_rng(position))
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
