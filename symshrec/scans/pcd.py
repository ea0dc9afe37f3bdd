"""Clouds in pcd, the Point Cloud Library's: text, binary, or binary packed with LZF."""

import io
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from symshrec.scans.cloud import AXES, CloudFileError, FileCloud, axis_places, left_out, refuse_not_finite
from symshrec.scans.polygons import coordinates
from symshrec.scans.source import Source, most_unpacked

TYPES = {"F": "f", "I": "i", "U": "u"}
SIZES = {"F": (4, 8), "I": (1, 2, 4, 8), "U": (1, 2, 4, 8)}
LISTS = ("FIELDS", "SIZE", "TYPE", "COUNT")
OTHERS = ("VERSION", "WIDTH", "HEIGHT", "VIEWPOINT", "POINTS", "DATA")
LONGEST_HEADER = 100_000  # bytes
CUT = "it may be cut short: export or copy it again"


@dataclass
class Header:
    """Fields with their types and counts, how many points, how they are stored, and the place of the first byte."""

    fields: list[str] = field(default_factory=list)
    types: list[str] = field(default_factory=list)
    counts: list[int] = field(default_factory=list)
    points: int = 0
    data: str = ""
    lines: int = 0
    end: int = 0


def read_pcd(source: Source) -> FileCloud:
    """The cloud in a pcd file, from its fields x, y and z. A sensor's places without a measurement, which pcd writes as
    points of NaN alone, are left out.

    Raises:
        CloudFileError: naming the line, for a header that is none, claims more points than follow or has no x, y and z,
            for text that is no table of numbers, and for points that are only partly finite.
    """
    content, path = source.read(), source.path
    header = _header(content, path)
    names = [name for name, count in zip(header.fields, header.counts, strict=True) for _ in range(count)]
    if (places := axis_places(names)) is None:
        raise CloudFileError(f"{path}: its fields are {' '.join(header.fields)[:80]}; points need x, y and z")
    read = {"ascii": _text, "binary": _binary, "binary_compressed": _packed}[header.data]
    points = read(content, header, places, path)
    measured = ~np.isnan(points).all(axis=1)
    missing = len(points) - int(measured.sum())
    points = points[measured] if missing else points
    if not len(points):
        raise CloudFileError(f"{path}: there are no points in it; {CUT}")
    refuse_not_finite(points, path)
    notes = (f"{missing:,} places without a measurement (NaN) left out",) if missing else ()
    return FileCloud(points, (*notes, *left_out(len(names) - len(AXES))))


def _header(content: bytes, path: Path) -> Header:
    words: dict[str, list[str]] = {}
    end, line = 0, 0
    while "DATA" not in words:
        start, end = end, content.find(b"\n", end, LONGEST_HEADER) + 1
        line += 1
        if not end:
            raise CloudFileError(f"{path}: its header has no line 'DATA ascii', binary or binary_compressed; {CUT}")
        key, *rest = content[start:end].decode("utf-8", "replace").split() or ["#"]
        if key.startswith("#"):
            continue
        if key not in (*LISTS, *OTHERS):
            raise CloudFileError(f"{path}:{line}: {key[:40]!r} is no line of a pcd header; {CUT}")
        words[key] = rest
    fields, sizes, types = (words.get(name, []) for name in LISTS[:3])
    counts = words.get("COUNT", ["1"] * len(fields))
    if not fields or not len(fields) == len(sizes) == len(types) == len(counts):
        raise CloudFileError(f"{path}: its header has {len(fields)} FIELDS, but other numbers of SIZE, TYPE or COUNT")
    numbers = [_whole(word, path) for word in (*sizes, *counts)]
    for size, kind in zip(numbers, types, strict=False):
        if size not in SIZES.get(kind, ()):
            raise CloudFileError(
                f"{path}: its header has a field of TYPE {kind[:9]} and SIZE {size}, which pcd has not"
            )
    found = Header(fields, [f"<{TYPES[kind]}{size}" for kind, size in zip(types, numbers, strict=False)])
    found.counts, found.lines, found.end = numbers[len(fields) :], line, end
    found.data = " ".join(words["DATA"]).lower()
    if found.data not in ("ascii", "binary", "binary_compressed") or sum(found.counts) > LONGEST_HEADER:
        raise CloudFileError(f"{path}:{line}: it holds {found.data[:40]!r}; pcd is ascii, binary or binary_compressed")
    sides = [_whole((words.get(name) or ["1"])[0], path) for name in ("WIDTH", "HEIGHT")]
    found.points = _whole(words["POINTS"][0], path) if words.get("POINTS") else sides[0] * sides[1]
    return found


def _whole(word: str, path: Path) -> int:
    if not (word.isascii() and word.isdecimal() and len(word) < 16):
        raise CloudFileError(f"{path}: its header has {word[:40]!r} where a whole number should be; {CUT}")
    return int(word)


def _text(content: bytes, header: Header, places: tuple[int, int, int], path: Path) -> np.ndarray:
    text, width = content[header.end :].decode("utf-8", "replace"), sum(header.counts)
    with suppress(ValueError):
        rows = np.loadtxt(io.StringIO(text), comments=None, ndmin=2)
        if rows.shape == (header.points, width):
            return rows[:, places]
    lines = [(number, words) for number, row in enumerate(text.split("\n"), header.lines + 1) if (words := row.split())]
    if len(lines) != header.points:
        raise CloudFileError(f"{path}: {len(lines)} of the {header.points} points that its header counts; {CUT}")
    for line, words in lines:
        if len(words) != width:
            raise CloudFileError(f"{path}:{line}: {len(words)} columns, but its fields are {width}; {CUT}")
    return coordinates([[words[place] for place in places] for _, words in lines], [line for line, _ in lines], path)


def _binary(content: bytes, header: Header, places: tuple[int, int, int], path: Path) -> np.ndarray:
    types = [kind for kind, count in zip(header.types, header.counts, strict=True) for _ in range(count)]
    row = np.dtype([(str(place), kind) for place, kind in enumerate(types)])
    _require(len(content) - header.end, header.points * row.itemsize, header, path)
    rows = np.frombuffer(content, row, header.points, header.end)
    return np.stack([rows[str(place)] for place in places], axis=1, dtype=np.float64)


def _packed(content: bytes, header: Header, places: tuple[int, int, int], path: Path) -> np.ndarray:
    """All values of a field follow each other, and LZF packs them together."""
    packed, size = (int.from_bytes(content[at : at + 4], "little") for at in (header.end, header.end + 4))
    _require(len(content) - header.end - 8, packed, header, path)
    if size > most_unpacked(len(content)):
        raise CloudFileError(f"{path}: it unpacks to {size:,} bytes, which is no cloud")
    values = _unpacked(content[header.end + 8 : header.end + 8 + packed], size, path)
    types = [kind for kind, count in zip(header.types, header.counts, strict=True) for _ in range(count)]
    starts = np.cumsum([0, *(header.points * np.dtype(kind).itemsize for kind in types)]).tolist()
    _require(size, starts[-1], header, path)
    columns = [np.frombuffer(values, types[place], header.points, starts[place]) for place in places]
    return np.stack(columns, axis=1, dtype=np.float64)


def _unpacked(packed: bytes, size: int, path: Path) -> bytes:
    """LZF: a byte below 32 is followed by one more byte than it says; any other names bytes that were there before."""
    out, at, end = bytearray(), 0, len(packed)
    try:
        while at < end and len(out) <= size:
            control = packed[at]
            at += 1
            if control < 32:
                out += packed[at : at + control + 1]
                at += control + 1
                continue
            length = control >> 5
            if length == 7:
                length += packed[at]
                at += 1
            start = len(out) - ((control & 31) << 8) - packed[at] - 1
            at += 1
            if start < 0:
                raise IndexError
            for place in range(start, start + length + 2, max(1, len(out) - start)):  # it may reach into itself
                out += out[place : min(start + length + 2, len(out))]
    except IndexError:
        out.clear()
    if at != end or len(out) != size:
        raise CloudFileError(f"{path}: its points do not unpack; {CUT}")
    return bytes(out)


def _require(there: int, needed: int, header: Header, path: Path) -> None:
    if needed > there:
        raise CloudFileError(
            f"{path}: {max(0, there)} bytes are too few for the {header.points} points that its header counts; {CUT}"
        )
