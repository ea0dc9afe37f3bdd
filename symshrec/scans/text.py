"""Clouds in text: a point a line, in columns that spaces, tabs, commas or semicolons part."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from symshrec.scans.cloud import CloudFileError, FileCloud

COMMENTS = ("#", "//", "%")
ENCODING = "utf-8-sig"  # as UTF-8, with the mark that Windows puts in front or without
AXES = ("x", "y", "z")


@dataclass(frozen=True)
class TextLayout:
    """How a text is laid out, by its first lines.

    delimiter: None for spaces and tabs. columns: places of x, y and z. skipped: lines above the first point.
    width: columns of the first point. header: the line that names the columns or counts the points, "" without one.
    """

    delimiter: str | None
    columns: tuple[int, int, int]
    skipped: int
    width: int
    header: str


def read_text(path: Path) -> FileCloud:
    """The cloud of a txt, xyz or csv file.

    Lines that begin with #, // or % are comments. One line above the points may name the columns or count the points;
    columns that it calls x, y and z are taken, else the first three. All others are left out.

    Raises:
        CloudFileError: naming file and line, for a file without points, fewer than three columns, and anything among
            the coordinates that is not a finite number.
    """
    layout = _layout(path)
    try:
        points = np.loadtxt(
            path,
            delimiter=layout.delimiter,
            comments=_comments(path),
            skiprows=layout.skipped,
            usecols=layout.columns,
            encoding=ENCODING,
            ndmin=2,
        )
    except ValueError as error:
        raise _complaint(path, layout) or CloudFileError(f"{path}: not a table of numbers ({error})") from error
    if not np.isfinite(points).all():
        raise _complaint(path, layout) or CloudFileError(f"{path}: it holds coordinates that are not finite")
    return FileCloud(points, tuple(_notes(layout)))


def _layout(path: Path) -> TextLayout:
    header = ""
    for number, line in islice(_content(path), 2):
        delimiter = next((mark for mark in ",;" if mark in line), None)
        fields = _fields(line, delimiter)
        if not header and not _is_point(fields) and (len(fields) == 1 or not _is_number(fields[0])):
            header = line
            continue
        columns = _columns(_fields(header, delimiter))
        layout = TextLayout(delimiter, columns, number - 1, len(fields), header)
        if (problem := _problem(fields, layout)) is not None:
            raise CloudFileError(f"{path}:{number}: {problem}")
        return layout
    if header:
        raise CloudFileError(f"{path}:1: {header[:40]!r} is all there is; write one point a line: x y z")
    raise CloudFileError(f"{path}: the file is empty; it should hold one point a line: x y z")


def _content(path: Path) -> Iterator[tuple[int, str]]:
    """Lines that are neither blank nor comments, stripped, with their numbers from 1."""
    try:
        with open(path, encoding=ENCODING) as lines:
            for number, line in enumerate(lines, 1):
                line = line.strip()
                if "\0" in line:
                    raise CloudFileError(f"{path}:{number}: this is no UTF-8 text; save it as such, or name its format")
                if line and not line.startswith(COMMENTS):
                    yield number, line
    except UnicodeDecodeError as error:
        raise CloudFileError(f"{path}: this is no UTF-8 text ({error}); save it as such") from error


def _fields(line: str, delimiter: str | None) -> list[str]:
    for mark in COMMENTS:
        line = line.split(mark, 1)[0]
    return [field.strip() for field in line.split(delimiter)]


def _comments(path: Path) -> list[str]:
    """The marks of comments that the file has: numpy reads at two thirds of the speed where it looks for several."""
    content = path.read_bytes()
    return [mark for mark in COMMENTS if mark.encode() in content]


def _columns(names: list[str]) -> tuple[int, int, int]:
    names = [name.strip("\"' ").lower() for name in names]
    if not set(AXES) <= set(names):
        return 0, 1, 2
    x, y, z = map(names.index, AXES)
    return x, y, z


def _is_point(fields: list[str]) -> bool:
    return len(fields) >= len(AXES) and all(map(_is_number, fields[: len(AXES)]))


def _is_number(field: str) -> bool:
    try:
        float(field)
    except ValueError:
        return False
    return True


def _problem(fields: list[str], layout: TextLayout) -> str | None:
    """What is wrong with the fields of a point's line, None where nothing is."""
    if len(fields) <= max(layout.columns):
        found = f"{len(fields)} column{'s' * (len(fields) != 1)}"
        zeros = "; add one of zeros to a planar cloud" * (len(fields) == len(AXES) - 1)
        return f"{found}, but a point needs three numbers, x y z{zeros}"
    for axis, column in zip(AXES, layout.columns, strict=True):
        field = fields[column]
        if not _is_number(field) or not np.isfinite(float(field)):
            return f"{axis} is {field[:40]!r}; it should be a finite number: mend or remove the line"
    return None


def _complaint(path: Path, layout: TextLayout) -> CloudFileError | None:
    """The error for the first line that is no point."""
    for number, line in _content(path):
        if number > layout.skipped and (problem := _problem(_fields(line, layout.delimiter), layout)):
            return CloudFileError(f"{path}:{number}: {problem}")
    return None


def _notes(layout: TextLayout) -> Iterator[str]:
    if layout.header:
        yield f"its first line, {layout.header[:40]!r}, taken as a header"
    if layout.width > len(AXES):
        more = layout.width - len(AXES)
        yield f"{more} more column{'s' * (more > 1)} left out"
