"""A cloud as it came out of somebody's file, and the error for a file that gives none."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from symshrec.geometry.triangles import MeshSurface

if TYPE_CHECKING:
    from symshrec.scans.polygons import Mesh

AXES = ("x", "y", "z")
WIDEST = 64  # columns a table of three points may have; a wider one lies on its side


class CloudFileError(ValueError):
    """A file from which no cloud can be read: which, where in it where that is known, why, and what to do."""


@dataclass(frozen=True, eq=False)
class FileCloud:
    """points (N, 3) float64, finite, in the file's own units; notes: what was done or left out, for the user to know.

    triangles: of the mesh on whose surface the points were drawn; 0 where the file holds the points themselves.
    mesh: that mesh; None where there is none.
    """

    points: np.ndarray
    notes: tuple[str, ...] = ()
    triangles: int = 0
    mesh: "Mesh | None" = None

    @cached_property
    def surface(self) -> MeshSurface | None:
        """The mesh's surface, for distances from it."""
        return None if self.mesh is None else MeshSurface(*self.mesh)


def axis_places(names: Sequence[str]) -> tuple[int, int, int] | None:
    """Places of the columns called x, y and z, however they are written; None where one of them is not there."""
    plain = [name.strip("\"' ").lower() for name in names]
    if not set(AXES) <= set(plain):
        return None
    x, y, z = map(plain.index, AXES)
    return x, y, z


def three_columns(rows: np.ndarray, path: Path) -> FileCloud:
    """The cloud in the first three columns of an array.

    Raises:
        CloudFileError: for a shape other than (N ≥ 1, at least 3) and for coordinates that are not finite.
    """
    if rows.ndim != 2 or not rows.size:
        raise CloudFileError(f"{path}: the array has shape {rows.shape}; a cloud is (N, 3), one row a point")
    if rows.shape[1] < 3:
        raise CloudFileError(
            f"{path}: the array has shape {rows.shape}; points have three columns, x y z: add one of zeros to a planar "
            "cloud"
        )
    if len(rows) == 3 and rows.shape[1] > WIDEST:
        raise CloudFileError(f"{path}: the array has shape {rows.shape}; one row is one point: transpose it")
    points = np.ascontiguousarray(rows[:, :3], dtype=np.float64)
    refuse_not_finite(points, path)
    return FileCloud(points, left_out(rows.shape[1] - 3))


def left_out(columns: int) -> tuple[str, ...]:
    """The note for columns beside the coordinates; none without them."""
    return (f"{columns} more column{'s' * (columns > 1)} left out",) if columns else ()


def refuse_not_finite(points: np.ndarray, path: Path) -> None:
    """Name the first point, counted from 1, that is not finite.

    Raises:
        CloudFileError: where there is one.
    """
    if not np.isfinite(points).all():
        finite = np.isfinite(points).all(axis=1)
        first, count = int(np.argmin(finite)), int((~finite).sum())
        raise CloudFileError(
            f"{path}: point {first + 1} is {' '.join(f'{value:g}' for value in points[first])} ({count} such of "
            f"{len(points)}); remove the points that are not finite"
        )


@contextmanager
def readable(path: Path, kind: str, again: str) -> Iterator[None]:
    """Whatever a package raises about a file within becomes one line that names it and ends with what to do.

    A panic in a package's Rust is no Exception, but comes from the file as well.
    """
    try:
        yield
    except (CloudFileError, FileNotFoundError, PermissionError, MemoryError):
        raise
    except BaseException as error:
        if not isinstance(error, Exception) and type(error).__name__ != "PanicException":
            raise
        text = " ".join(str(error).split())[:160] or type(error).__name__
        raise CloudFileError(f"{path}: it cannot be read as {kind} ({text}); {again}") from error
