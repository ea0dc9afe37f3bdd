"""§2.1–2.2 One cloud of the benchmark with its true planes and everything known about how it was made."""

from dataclasses import dataclass, field

import numpy as np

from symshrec.benchmark import perturbations
from symshrec.planes import Planes

FAMILIES = (
    "astroid",
    "citrus",
    "m_convexities",
    "geometric_petal",
    "lemniscate_bernoulli",
    "egg_keplero",
    "mouth_curve",
)  # Table 4's S1–S7, in its order and under the names of published.csv
PLANELESS = "planeless"  # ours: shapes without a mirror plane
ALL_FAMILIES = (*FAMILIES, PLANELESS)
SOLIDS = ("cylinder", "cone")
PLANELESS_SOLIDS = ("sheared", "glued", "blob")
ALL_SOLIDS = (*SOLIDS, *PLANELESS_SOLIDS)
PERTURBATIONS = tuple(perturbations.PERTURBATIONS)
PUBLISHED_PERTURBATIONS = tuple(perturbations.PUBLISHED_PERTURBATIONS)  # P0–P5: a split's, unless it names others
HARD_PERTURBATIONS = tuple(perturbations.HARD_PERTURBATIONS)  # ours: P6–P9
SCAN_PERTURBATIONS = tuple(perturbations.SCAN_PERTURBATIONS)  # ours: P10–P15
UNKNOWN = "unknown"  # a label that the track's own files do not give


@dataclass(frozen=True)
class Labels:
    """How a cloud was made; UNKNOWN where a file does not say.

    parameters: of the curve, the extrusion and the perturbation, by name (a, b, m, height, ...).
    rotation (3, 3) and translation (3,): the pose, x ↦ rotation x + translation.
    """

    family: str = UNKNOWN
    solid: str = UNKNOWN
    perturbation: str = UNKNOWN
    parameters: dict[str, float] = field(default_factory=dict)
    rotation: np.ndarray | None = None
    translation: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class LabelledCloud:
    """points (N, 3), true planes (None where the truth is withheld), labels, and the ID in its split.

    points: float32 of shards, which hold no more; float64 of text files, so that the diagonal is the one that the
    organisers' script reads there. Batches are float32 in any case.
    """

    points: np.ndarray
    planes: Planes | None
    labels: Labels
    id: int
    name: str

    @property
    def truth(self) -> Planes:
        """The true planes, where they must be known.

        Raises:
            ValueError: where they are withheld.
        """
        if self.planes is None:
            raise ValueError(f"the true planes of cloud {self.name} are withheld; take a split that has them")
        return self.planes

    @property
    def diagonal(self) -> float:
        """Length of the diagonal of the axis-aligned bounding box, in the cloud's units (§2.3's scale for ε), in
        float64."""
        return float(np.linalg.norm(np.ptp(self.points.astype(np.float64), axis=0)))
