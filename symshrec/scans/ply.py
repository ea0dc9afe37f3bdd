"""Vertices and faces of ply, text or binary: the points that scanners write, at once, and meshes of any polygons."""

import struct
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from symshrec.scans.cloud import CloudFileError
from symshrec.scans.polygons import Mesh, coordinates, number, of_polygons, triangulated, whole_numbers

ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
TYPES = {
    **{"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"},
    **{"int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4"},
    **{"float": "f4", "double": "f8", "float32": "f4", "float64": "f8"},
}
CORNERS = ("vertex_indices", "vertex_index")
END = b"end_header"
CUT = "it may be cut short: export or copy it again"


@dataclass
class Element:
    """A kind of rows: how many, and the properties of each with their types; a list has the type of its count too."""

    name: str
    count: int
    types: dict[str, str] = field(default_factory=dict)
    counts: dict[str, str] = field(default_factory=dict)

    @property
    def least(self) -> int:
        """Bytes of a row whose lists are all empty."""
        scalars = (each for name, each in self.types.items() if name not in self.counts)
        return sum(np.dtype(each).itemsize for each in (*scalars, *self.counts.values()))


def read_ply(content: bytes, path: Path) -> Mesh:
    """The mesh of a ply file, from x, y, z of its vertices and the vertex_indices of its faces.

    Raises:
        CloudFileError: naming the header's line, the text's line or the element, for a header that is none, fewer rows
            than it counts, and a vertex or face that cannot be.
    """
    head, found, rest = content.partition(END)
    if not content.startswith(b"ply") or not found:
        raise CloudFileError(
            f"{path}: it does not begin as a ply file does; give it its own extension, or export it again"
        )
    order, elements = _header(head.decode("utf-8", "replace"), path)
    body = len(content) - len(rest) + rest.find(b"\n") + 1 if b"\n" in rest else len(content)
    vertex, face = (next((each for each in elements if each.name == name), None) for name in ("vertex", "face"))
    if vertex is None or not set("xyz") <= set(vertex.types) - set(vertex.counts):
        raise CloudFileError(f"{path}: its header has no vertices with x, y and z; {CUT}")
    corners = next((name for name in CORNERS if face and name in face.counts and face.types[name][0] != "f"), None)
    if face and face.count and corners is None:
        raise CloudFileError(
            f"{path}: its header has faces without a list of whole numbers called {CORNERS[0]}; export it again"
        )
    read = _read_binary if order else _read_text
    return read(content, body, order, elements, corners, path)


def _header(text: str, path: Path) -> tuple[str, list[Element]]:
    """The order of bytes ("" for text) and the elements, in turn."""
    order, elements = None, []
    for line, words in enumerate(map(str.split, text.split("\n")[1:]), 2):
        match words:
            case [] | ["comment" | "obj_info", *_]:
                continue
            case ["format", kind, "1.0"] if kind in ORDERS and order is None:
                order = ORDERS[kind]
            case ["element", name, count] if count.isascii() and count.isdecimal() and len(count) < 19:
                if any(each.name == name for each in elements):
                    raise CloudFileError(f"{path}:{line}: the element {name[:40]!r} is there already")
                elements.append(Element(name, int(count)))
            case ["property", kind, name] if elements and kind in TYPES and name not in elements[-1].types:
                elements[-1].types[name] = TYPES[kind]
            case ["property", "list", count, kind, name] if (
                elements and kind in TYPES and TYPES.get(count, "f")[0] != "f" and name not in elements[-1].types
            ):
                elements[-1].types[name], elements[-1].counts[name] = TYPES[kind], TYPES[count]
            case _:
                raise CloudFileError(f"{path}:{line}: {' '.join(words)[:60]!r} is no line of a ply header; {CUT}")
    if order is None:
        raise CloudFileError(f"{path}: its header has no line 'format ascii 1.0' or of a binary format; {CUT}")
    return order, elements


def _read_binary(content: bytes, at: int, order: str, elements: list[Element], corners: str | None, path: Path) -> Mesh:
    vertices, polygons = np.zeros((0, 3)), None
    for element in elements:
        if element.count * element.least > len(content) - at:
            raise CloudFileError(
                f"{path}: it cannot be read as ply: {len(content) - at} bytes are too few for its {element.count} "
                f"rows of {element.name[:40]!r}; {CUT}"
            )
        wanted = corners if element.name == "face" else None
        columns, lists, at = _binary_rows(content, at, order, element, wanted, path)
        if element.name == "vertex":
            vertices = np.stack([columns[axis] for axis in "xyz"], axis=1, dtype=np.float64)
        elif wanted:
            polygons = lists
    if at != len(content):
        raise CloudFileError(f"{path}: it cannot be read as ply: {len(content) - at} bytes more than its header counts")
    triangles = np.zeros((0, 3), np.int64)
    if polygons is not None:
        values, lengths = polygons
        triangles = triangulated(values, lengths, len(vertices), lambda row: f"{path}: face {row + 1}")
    return Mesh(vertices, triangles)


def _binary_rows(content: bytes, at: int, order: str, element: Element, wanted: str | None, path: Path):
    """An element's rows from byte `at` on: its columns, the wanted list as values and lengths, and where it ends."""
    lengths = _first_lengths(content, at, order, element) if element.count and element.counts else {}
    if max(lengths.values(), default=0) > len(content):
        return _uneven_rows(content, at, order, element, wanted, path)
    row: list[tuple] = []
    for place, (name, kind) in enumerate(element.types.items()):
        if name in element.counts:
            row.append((f"count {place}", order + element.counts[name]))
            row.append((f"{place}", order + kind, (max(0, lengths.get(name, 0)),)))
        else:
            row.append((f"{place}", order + kind))
    dtype, places = np.dtype(row), {name: str(place) for place, name in enumerate(element.types)}
    end = at + element.count * dtype.itemsize
    if end <= len(content):
        rows = np.frombuffer(content, dtype, element.count, at) if dtype.itemsize else np.zeros(0, dtype)
        even = all((rows[f"count {places[name]}"] == length).all() for name, length in lengths.items())
        if even and min(lengths.values(), default=0) >= 0:
            columns = {name: rows[place] for name, place in places.items() if name not in element.counts}
            if wanted is None:
                return columns, None, end
            values = rows[places[wanted]].reshape(-1).astype(np.int64)
            return columns, (values, np.full(element.count, lengths.get(wanted, 0))), end
    return _uneven_rows(content, at, order, element, wanted, path)


def _first_lengths(content: bytes, at: int, order: str, element: Element) -> dict[str, int]:
    """The lengths of the first row's lists, which most files have in every row."""
    lengths = {}
    for name, kind in element.types.items():
        if name in element.counts:
            count = np.dtype(order + element.counts[name])
            lengths[name] = int.from_bytes(
                content[at : at + count.itemsize], "big" if order == ">" else "little", signed=count.kind == "i"
            )
            at += count.itemsize + max(0, lengths[name]) * np.dtype(kind).itemsize
        else:
            at += np.dtype(kind).itemsize
    return lengths


def _uneven_rows(content: bytes, at: int, order: str, element: Element, wanted: str | None, path: Path):
    """As `_binary_rows`, row by row, for lists of different lengths."""
    scalars = {name: [] for name in element.types if name not in element.counts}
    values, lengths = [], []
    for row in range(element.count):
        for name, kind in element.types.items():
            count = 1
            try:
                if name in element.counts:
                    (count,), at = _unpack(content, at, order, element.counts[name], 1)
                read, at = _unpack(content, at, order, kind, count)
            except struct.error:
                raise CloudFileError(
                    f"{path}: it cannot be read as ply: {element.name[:40]} {row + 1} of {element.count} goes beyond "
                    f"its end; {CUT}"
                ) from None
            if name in scalars:
                scalars[name].extend(read)
            elif name == wanted:
                values.extend(map(int, read))
                lengths.append(count)
    columns = {name: np.array(each, dtype=np.float64) for name, each in scalars.items()}
    return columns, (values, lengths) if wanted else None, at


def _unpack(content: bytes, at: int, order: str, kind: str, count: int) -> tuple[tuple, int]:
    size = count * int(kind[1])
    if count < 0 or at + size > len(content):
        raise struct.error
    letter = {"i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I", "f4": "f", "f8": "d"}[kind]
    return struct.unpack_from(f"{order}{count}{letter}", content, at), at + size


def _read_text(content: bytes, at: int, order: str, elements: list[Element], corners: str | None, path: Path) -> Mesh:
    above = content[:at].count(b"\n")
    numbered = enumerate(content[at:].decode("utf-8", "replace").split("\n"), above + 1)
    rows = [(line, words) for line, text in numbered if (words := text.split())]
    expected = sum(each.count for each in elements if each.types)
    if len(rows) != expected:
        raise CloudFileError(f"{path}: {len(rows)} of the {expected} lines that its header counts; {CUT}")
    vertices, start = np.zeros((0, 3)), 0
    polygons: list[list[int]] = []
    lines: list[int] = []
    for element in elements:
        own = rows[start : start + element.count] if element.types else []
        start += len(own)
        if element.name == "vertex":
            vertices = _text_vertices(own, element, path)
        elif element.name == "face" and corners:
            polygons = [_text_fields(each, element, path)[corners] for each in own]
            lines = [line for line, _ in own]
    return Mesh(vertices, of_polygons(polygons, lines, len(vertices), path))


def _text_vertices(rows: list[tuple[int, list[str]]], element: Element, path: Path) -> np.ndarray:
    names, lines = list(element.types), [line for line, _ in rows]
    if element.counts:
        fields = [_text_fields(each, element, path) for each in rows]
        return np.array([[each[axis] for axis in "xyz"] for each in fields], dtype=np.float64).reshape(-1, 3)
    for line, words in rows:
        if len(words) != len(names):
            raise CloudFileError(f"{path}:{line}: {len(words)} columns, but a vertex has {len(names)}; {CUT}")
    places = [names.index(axis) for axis in "xyz"]
    return coordinates([[words[place] for place in places] for _, words in rows], lines, path)


def _text_fields(row: tuple[int, list[str]], element: Element, path: Path) -> dict:
    """The values of a line by property, lists as whole numbers."""
    (line, words), fields, at = row, {}, 0
    for name in element.types:
        count = 1
        if name in element.counts:
            count = number(words[at], line, path, int) if at < len(words) else 0
            at += 1
        if count < 0 or at + count > len(words):
            raise CloudFileError(f"{path}:{line}: its {name[:40]} goes beyond the line's {len(words)} columns; {CUT}")
        own = words[at : at + count]
        at += count
        if name not in element.counts:
            fields[name] = number(own[0], line, path)
        elif element.types[name][0] != "f":
            fields[name] = whole_numbers(own, line, path)
        else:
            fields[name] = []
    if at != len(words):
        raise CloudFileError(f"{path}:{line}: {len(words)} columns instead of {at}; {CUT}")
    return fields
