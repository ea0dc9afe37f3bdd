"""Clouds in text: a point a line, in columns that spaces, tabs, commas or semicolons part."""

import io
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice
from typing import TextIO

import numpy as np

from symshrec.scans.cloud import AXES, CloudFileError, FileCloud, axis_places, left_out
from symshrec.scans.source import Source

COMMENTS = ("#", "//", "%")
ENCODING = "utf-8-sig"  # as UTF-8, with the mark that Windows puts in front or without
DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?")
GRID = "ncols"  # how ESRI's asc begins, heights over a grid and no points


@dataclass(frozen=True)
class TextLayout:
    """How a text is laid out, by its first lines.

    delimiter: None for spaces and tabs. columns: places of x, y and z. skipped: lines above the first point.
    width: columns of the first point. header: the line that names the columns or counts the points, "" without one.
    decimal_commas: whether coordinates are written as 1,5.
    """

    delimiter: str | None
    columns: tuple[int, int, int]
    skipped: int
    width: int
    header: str
    decimal_commas: bool = False


def read_text(source: Source) -> FileCloud:
    """The cloud of a txt, xyz, csv, pts or asc file.

    Lines that begin with #, // or % are comments. One line above the points may name the columns or count the points;
    columns that it calls x, y and z are taken, else the first three. All others are left out. Coordinates may have
    decimal commas where columns are parted by something else.

    Raises:
        CloudFileError: naming file and line, for a file without points, fewer than three columns, and anything among
            the coordinates that is not a finite number.
    """
    layout = _layout(source)
    try:
        points = _table(source, layout)
    except ValueError as error:
        commas = replace(layout, decimal_commas=True)  # which the first points, of whole numbers, did not show
        if layout.delimiter == "," or layout.decimal_commas or _complaint(source, commas):
            raise _complaint(source, layout) or CloudFileError(
                f"{source.path}: not a table of numbers ({error})"
            ) from error
        layout, points = commas, _table(source, commas)
    if not np.isfinite(points).all():
        raise _complaint(source, layout) or CloudFileError(f"{source.path}: it holds coordinates that are not finite")
    return FileCloud(points, tuple(_notes(layout)))


def _table(source: Source, layout: TextLayout) -> np.ndarray:
    load = partial(
        np.loadtxt,
        delimiter=layout.delimiter,
        comments=_comments(source),
        skiprows=layout.skipped,
        usecols=layout.columns,
        ndmin=2,
    )
    if source.content is None and not layout.decimal_commas:
        return load(source.path, encoding=ENCODING)  # faster than from lines
    with _lines(source) as lines:
        return load(line.replace(",", ".") for line in lines) if layout.decimal_commas else load(lines)


def _layout(source: Source) -> TextLayout:
    header, path = "", source.path
    for number, line in islice(_content(source), 2):
        delimiter, commas = _delimiter(line)
        fields = _fields(line, delimiter)
        if line.lower().startswith(GRID):
            raise CloudFileError(f"{path}:{number}: this is a grid of heights and no list of points; save it as x y z")
        if not header and not _is_point(fields, commas) and (len(fields) == 1 or not _is_number(fields[0], commas)):
            header = line
            continue
        columns = axis_places(_fields(header, delimiter)) or (0, 1, 2)
        layout = TextLayout(delimiter, columns, number - 1, len(fields), header, commas)
        if (problem := _problem(fields, layout)) is not None:
            raise CloudFileError(f"{path}:{number}: {problem}")
        return layout
    if header:
        raise CloudFileError(f"{path}:1: {header[:40]!r} is all there is; write one point a line: x y z")
    raise CloudFileError(f"{path}: the file is empty; it should hold one point a line: x y z")


def _delimiter(line: str) -> tuple[str | None, bool]:
    """What parts the columns of a line, None for spaces and tabs; and whether its numbers have decimal commas."""
    least = len(AXES)
    for mark, parts in ((";", ";"), ("\t", None)):
        fields = _fields(line, mark)
        if len(fields) >= least and any(map(DECIMAL_COMMA.fullmatch, fields)):
            return parts, True
    words = _fields(line, None)
    if _is_point(words, decimal_commas=True) and any(map(DECIMAL_COMMA.fullmatch, words[:least])):
        return None, True
    marks = [mark for mark in ",;" if any(mark in word for word in words)]
    points = (mark for mark in marks if _is_point(_fields(line, mark), decimal_commas=False))
    return next(points, marks[0] if marks else None), False


@contextmanager
def _lines(source: Source) -> Iterator[TextIO]:
    with io.TextIOWrapper(source.open(), encoding=ENCODING) as lines:
        yield lines


def _content(source: Source) -> Iterator[tuple[int, str]]:
    """Lines that are neither blank nor comments, stripped, with their numbers from 1."""
    path = source.path
    try:
        with _lines(source) as lines:
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


def _comments(source: Source) -> list[str]:
    """The marks of comments that the file has: numpy reads at two thirds of the speed where it looks for several."""
    content = source.read()
    return [mark for mark in COMMENTS if mark.encode() in content]


def _is_point(fields: list[str], decimal_commas: bool) -> bool:
    return len(fields) >= len(AXES) and all(_is_number(each, decimal_commas) for each in fields[: len(AXES)])


def _is_number(field: str, decimal_commas: bool = False) -> bool:
    try:
        float(field.replace(",", ".") if decimal_commas else field)
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
        field = fields[column].replace(",", ".") if layout.decimal_commas else fields[column]
        if not _is_number(field) or not np.isfinite(float(field)):
            return f"{axis} is {fields[column][:40]!r}; it should be a finite number: mend or remove the line"
    return None


def _complaint(source: Source, layout: TextLayout) -> CloudFileError | None:
    """The error for the first line that is no point."""
    for number, line in _content(source):
        if number > layout.skipped and (problem := _problem(_fields(line, layout.delimiter), layout)):
            return CloudFileError(f"{source.path}:{number}: {problem}")
    return None


def _notes(layout: TextLayout) -> Iterator[str]:
    if layout.header:
        yield f"its first line, {layout.header[:40]!r}, taken as a header"
    if layout.decimal_commas:
        yield "commas taken as decimal points"
    yield from left_out(layout.width - len(AXES))
