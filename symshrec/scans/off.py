"""Vertices and faces of off, with or without colours and normals beside them."""

import re
from itertools import islice
from pathlib import Path

from symshrec.scans.cloud import CloudFileError
from symshrec.scans.polygons import Mesh, coordinates, counted, number, of_polygons

HEADER = re.compile(r"(?:ST)?C?N?OFF\s*(.*)")
CUT = "it may be cut short: export or copy it again"


def read_off(text: str, path: Path) -> Mesh:
    """The mesh of an off's text.

    Raises:
        CloudFileError: naming the line, for a header or count that is none, for fewer lines than are counted, and for
            a vertex or a face that cannot be.
    """
    lines = enumerate((line.split("#", 1)[0].strip() for line in text.split("\n")), 1)
    content = [(number_, line) for number_, line in lines if line]
    header = HEADER.fullmatch(content[0][1]) if content else None
    if not header:
        raise CloudFileError(f"{path}: it cannot be read as off: its first word is not OFF; {CUT}")
    content = [(content[0][0], header[1]), *content[1:]] if header[1] else content[1:]
    place, counts = content[0] if content else (1, "")
    words = [number(word, place, path, int) for word in counts.split()]
    if len(words) < 2 or min(words[:2]) < 0:
        raise CloudFileError(f"{path}:{place}: cannot be read as off: {counts[:40]!r} counts no vertices and faces")
    vertices, faces = words[:2]
    if vertices + faces > len(content) - 1:
        found = f"{len(content) - 1} of the {str(vertices + faces)[:40]} lines that its header counts"
        raise CloudFileError(f"{path}: it cannot be read as off: {found}; {CUT}")
    rows = [(line, each.split()[:3]) for line, each in islice(content, 1, vertices + 1)]
    polygons = [(line, counted(each.split(), line, path)) for line, each in content[vertices + 1 :][:faces]]
    points = coordinates([each for _, each in rows], [line for line, _ in rows], path)
    return Mesh(points, of_polygons([each for _, each in polygons], [line for line, _ in polygons], vertices, path))
