"""The one currency between rooms: a set of mirror planes, each a normal, a point and a confidence (§2.2)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from symshrec.planes.groups import PointGroup

MIN_NORMAL_LENGTH = 1e-12
UNIT_LENGTH_ROUNDING = 1e-15


@dataclass(frozen=True, eq=False)
class Planes:
    """K mirror planes of one cloud, in the cloud's own coordinates.

    Args:
        normals: (K, 3), any non-zero length; stored as unit vectors. The sign carries no meaning.
        points: (K, 3), a point on each plane.
        confidences: (K,), higher ranks first; all 1 where omitted.

    Raises:
        ValueError: naming the array and row, for a wrong shape, a value that is not finite or a zero normal.

    >>> planes = Planes([[0, 0, 2], [1, 0, 0]], [[0, 0, 1], [0, 5, 0]], [0.5, 0.9])
    >>> planes.normals.tolist(), planes.offsets.tolist()
    ([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]], [1.0, 0.0])
    >>> planes.ranked().confidences.tolist()
    [0.9, 0.5]
    """

    normals: np.ndarray
    points: np.ndarray
    confidences: np.ndarray = None  # type: ignore[assignment]  # ones where none are given

    def __post_init__(self):
        normals = np.asarray(self.normals, dtype=np.float64)
        points = np.asarray(self.points, dtype=np.float64)
        count = len(normals) if normals.ndim else 0
        confidences = np.ones(count) if self.confidences is None else self.confidences
        confidences = np.asarray(confidences, dtype=np.float64)
        arrays = {"normals": normals, "points": points, "confidences": confidences}
        for (name, array), expected in zip(arrays.items(), ((count, 3), (count, 3), (count,)), strict=True):
            if array.shape != expected:
                raise ValueError(f"{name} have shape {array.shape}, expected {expected}")
            finite = np.isfinite(array)
            if not finite.all():
                raise ValueError(f"{name} row {int(np.argwhere(~finite)[0, 0])} is not finite")
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        if (lengths < MIN_NORMAL_LENGTH).any():
            raise ValueError(f"normals row {int(np.argmin(lengths))} has zero length; a plane needs a direction")
        lengths[np.abs(lengths - 1) < UNIT_LENGTH_ROUNDING] = 1.0  # so that unit normals stay the same to the bit
        object.__setattr__(self, "normals", normals / lengths)
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "confidences", confidences)

    @classmethod
    def empty(cls) -> "Planes":
        """No plane at all: a valid answer for an asymmetric cloud."""
        return cls(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))

    def __len__(self) -> int:
        return len(self.normals)

    def __getitem__(self, rows) -> "Planes":
        """The planes at `rows`: a slice, a mask or an index array (a single int gives one plane)."""
        rows = [rows] if isinstance(rows, int | np.integer) else rows
        return Planes(self.normals[rows], self.points[rows], self.confidences[rows])

    @property
    def offsets(self) -> np.ndarray:
        """Signed distances of the planes from the origin along their normals, (K,)."""
        return np.einsum("kd,kd->k", self.normals, self.points)

    def ranked(self) -> "Planes":
        """The same planes by confidence, descending; ties keep their order."""
        return self[np.argsort(-self.confidences, kind="stable")]

    def canonical(self) -> "Planes":
        """The same planes with each normal's largest component positive and the foot point of the origin as point."""
        if not len(self):
            return self
        leading = np.take_along_axis(self.normals, np.abs(self.normals).argmax(1)[:, None], axis=1)
        normals = self.normals * np.where(leading < 0, -1.0, 1.0)
        return Planes(normals, normals * np.einsum("kd,kd->k", normals, self.points)[:, None], self.confidences)

    def transformed(self, rotation=None, translation=None, scale: float = 1.0) -> "Planes":
        """The planes of the cloud x ↦ scale · rotation x + translation; rotation (3, 3), translation (3,).

        >>> Planes([[1, 0, 0]], [[1, 0, 0]]).transformed(translation=[3, 0, 0], scale=2).offsets.tolist()
        [5.0]
        """
        rotation = np.eye(3) if rotation is None else np.asarray(rotation, dtype=np.float64)
        translation = np.zeros(3) if translation is None else np.asarray(translation, dtype=np.float64)
        points = scale * self.points @ rotation.T + translation
        return Planes(self.normals @ rotation.T, points, self.confidences)

    def group(self, diagonal: float | None = None, angle_deg: float = 1.0, distance: float = 0.01) -> "PointGroup":
        """The point group that the planes make, its axes of rotation and what is missing of it: see `point_group`.

        Args:
            diagonal: of the cloud: planes that pass the group's centre by more than `distance` of it are no part of the
                group; None: that planes meet is not asked.

        >>> group = Planes([[1, 0, 0], [0, 1, 0]], [[0, 0, 7], [0, 0, 7]]).group()
        >>> group.name, [axis.order for axis in group.axes]
        ('C2v', [2])
        """
        from symshrec.planes.groups import point_group  # which is of planes

        return point_group(self.normals, self.points, diagonal, angle_deg, distance)

    def mirror(self, points: np.ndarray) -> np.ndarray:
        """(N, 3) points mirrored across every plane: (K, N, 3).

        >>> Planes([[1, 0, 0]], [[1, 0, 0]]).mirror([[3, 4, 5]]).tolist()
        [[[-1.0, 4.0, 5.0]]]
        """
        points = np.asarray(points, dtype=np.float64)
        heights = points @ self.normals.T - self.offsets  # (N, K)
        return points[None] - 2 * heights.T[:, :, None] * self.normals[:, None, :]


@dataclass(frozen=True, eq=False)
class PackedPlanes:
    """The planes of C clouds end to end, for vectorised work and for files.

    normals (ΣK, 3), points (ΣK, 3), confidences (ΣK,), starts (C + 1,): cloud c owns rows starts[c]:starts[c + 1].

    >>> packed = PackedPlanes.pack([Planes(np.eye(3), np.zeros((3, 3))), Planes.empty()])
    >>> len(packed), packed.starts.tolist(), len(packed[0])
    (2, [0, 3, 3], 3)
    """

    normals: np.ndarray
    points: np.ndarray
    confidences: np.ndarray
    starts: np.ndarray

    @classmethod
    def pack(cls, planes: Sequence[Planes]) -> "PackedPlanes":
        """Lay the planes of many clouds end to end, in order."""
        planes = list(planes)
        starts = np.concatenate([[0], np.cumsum([len(each) for each in planes], dtype=np.int64)]).astype(np.int64)
        if not planes:
            planes = [Planes.empty()]
        return cls(
            np.concatenate([each.normals for each in planes]),
            np.concatenate([each.points for each in planes]),
            np.concatenate([each.confidences for each in planes]),
            starts,
        )

    def __len__(self) -> int:
        """Number of clouds."""
        return len(self.starts) - 1

    def __getitem__(self, cloud: int) -> Planes:
        rows = slice(self.starts[cloud], self.starts[cloud + 1])
        return Planes(self.normals[rows], self.points[rows], self.confidences[rows])

    @property
    def counts(self) -> np.ndarray:
        """Planes per cloud, (C,)."""
        return np.diff(self.starts)


def axis_angles(normals: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Angles in radians, [0, π/2], between unit normals (..., A, 3) and (..., B, 3), sign ignored: (..., A, B).

    >>> np.degrees(axis_angles(np.array([[1.0, 0, 0]]), np.array([[-1.0, 0, 0], [0, 1, 0]]))).tolist()
    [[0.0, 90.0]]
    """
    cross = np.linalg.norm(np.cross(normals[..., :, None, :], others[..., None, :, :]), axis=-1)
    return np.arctan2(cross, np.abs(normals @ np.swapaxes(others, -1, -2)))
