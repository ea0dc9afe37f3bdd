"""The faces of a mesh as triangles, whatever the format they are from."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from itertools import chain
from pathlib import Path
from typing import NamedTuple

import numpy as np

from symshrec.scans.cloud import CloudFileError


class Mesh(NamedTuple):
    """vertices (V, 3) float64 and triangles (F, 3) int64, places among them; either may be empty."""

    vertices: np.ndarray
    triangles: np.ndarray


class Assembly:
    """A mesh put together from parts, each in its place; a small file can name large parts any number of times.

    most: bytes that it may take.
    """

    def __init__(self, path: Path, most: int):
        self.path, self.room, self._count = path, most, 0
        self._vertices: list[np.ndarray] = []
        self._triangles: list[np.ndarray] = []

    def add(self, vertices: np.ndarray, triangles: np.ndarray, pose: np.ndarray) -> None:
        """Put a part, (V, 3) and (F, 3), in its place by a (4, 4) matrix.

        Raises:
            CloudFileError: for a corner that is not there, a matrix of another shape or kind, and too large a mesh.
        """
        if pose.shape != (4, 4) or not np.isfinite(pose).all() or (pose[3] != (0, 0, 0, 1)).any():
            raise CloudFileError(
                f"{self.path}: a part has a place that is no matrix of finite numbers; export it again"
            )
        if triangles.size and not 0 <= triangles.min() <= triangles.max() < len(vertices):
            raise CloudFileError(f"{self.path}: a face has a vertex that is not there; there are {len(vertices)}")
        self.room -= vertices.nbytes + triangles.nbytes
        if self.room < 0:
            raise CloudFileError(
                f"{self.path}: put together, its parts take more memory than a file of its size should; export it as "
                "one mesh"
            )
        self._vertices.append(vertices @ pose[:3, :3].T + pose[:3, 3])
        self._triangles.append(triangles + self._count)
        self._count += len(vertices)

    def mesh(self) -> Mesh:
        """All parts as one."""
        empty = np.zeros((0, 3))
        triangles = np.concatenate([empty.astype(np.int64), *self._triangles])
        return Mesh(np.concatenate([empty, *self._vertices]), triangles)


def triangulated(
    corners: Sequence[int] | np.ndarray, lengths: Sequence[int] | np.ndarray, vertices: int, where: Callable[[int], str]
) -> np.ndarray:
    """Polygons as fans of triangles: (F, 3) int64.

    Args:
        corners: places among the vertices, polygon after polygon. lengths: corners of each polygon.
        vertices: how many there are. where: the file, and line where it is known, of a polygon, for errors.

    Raises:
        CloudFileError: for a polygon of fewer than three corners, and for a corner that is not there.
    """
    lengths = np.asarray(lengths, dtype=np.int64)
    if (lengths < 3).any():
        row = int(np.argmax(lengths < 3))
        raise CloudFileError(f"{where(row)}: a face has {lengths[row]} corners, but needs three; remove it")
    ends = np.cumsum(lengths)
    try:
        indices = np.asarray(corners, dtype=np.int64)
        outside = (indices < 0) | (indices >= vertices)
    except OverflowError:
        outside = np.array([not 0 <= corner < vertices for corner in corners])
    if outside.any():
        place = int(np.argmax(outside))
        row = int(np.searchsorted(ends, place, side="right"))
        raise CloudFileError(f"{where(row)}: a face has a vertex that is not there; there are {vertices}")
    fans = lengths - 2
    first = np.repeat(ends - lengths, fans)
    step = np.arange(len(first)) - np.repeat(np.cumsum(fans) - fans, fans)
    return np.stack([indices[first], indices[first + step + 1], indices[first + step + 2]], axis=1)


def of_polygons(polygons: list[list[int]], lines: list[int], vertices: int, path: Path) -> np.ndarray:
    """As `triangulated`, for polygons that stand on the given lines of a text."""
    corners = list(chain.from_iterable(polygons))
    return triangulated(corners, [len(each) for each in polygons], vertices, lambda row: f"{path}:{lines[row]}")


def whole_numbers(words: list[str], line: int, path: Path) -> list[int]:
    """Words as whole numbers; errors as `number`."""
    try:
        if "_" not in "".join(words):
            return list(map(int, words))
    except ValueError:
        pass
    return [number(word, line, path, int) for word in words]


def counted(words: list[str], line: int, path: Path) -> list[int]:
    """The numbers after the one that counts them, of a face's line; what follows them, such as a colour, is left out.

    Raises:
        CloudFileError: naming the line, for fewer numbers than are counted or what is no whole number.
    """
    count = number(words[0], line, path, int)
    if not 0 <= count < len(words):
        raise CloudFileError(
            f"{path}:{line}: a face of {words[0][:40]} corners has {len(words) - 1} numbers; it may be cut short"
        )
    return whole_numbers(words[1 : count + 1], line, path)


def coordinates(rows: list[list[str]], lines: list[int], path: Path) -> np.ndarray:
    """(V, 3) float64 from three words of every vertex's line.

    Raises:
        CloudFileError: naming the first line with fewer words or one that is no number.
    """
    words = list(chain.from_iterable(rows))
    with suppress(ValueError):
        if len(words) == 3 * len(rows) and all(len(row) == 3 for row in rows) and "_" not in "".join(words):
            return np.fromiter(map(float, words), np.float64).reshape(-1, 3)
    for row, line in zip(rows, lines, strict=True):
        if len(row) < 3:
            raise CloudFileError(f"{path}:{line}: a vertex has {len(row)} coordinates, but needs three")
        for word in row[:3]:
            number(word, line, path)
    raise CloudFileError(f"{path}: its vertices are no numbers")


def number(word: str, line: int, path: Path, kind: type = float):
    """A word as a number of a kind.

    Raises:
        CloudFileError: naming the line where it is none.
    """
    try:
        if "_" not in word:  # which Python takes in numbers, and no format does
            return kind(word)
    except ValueError:
        pass
    what = "whole number" if kind is int else "number"
    raise CloudFileError(f"{path}:{line}: {word[:40]!r} is no {what}; mend or remove the line")
