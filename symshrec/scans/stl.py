"""The triangles of stl, binary or text; the normals in it follow from them and are passed over."""

from pathlib import Path

import numpy as np

from symshrec.scans.cloud import CloudFileError
from symshrec.scans.polygons import Mesh, coordinates

HEADER = 84  # bytes of a binary file, the last four of them the count of triangles
TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
AGAIN = "export or copy it again"


def read_stl(content: bytes, path: Path) -> Mesh:
    """The mesh of an stl file; each triangle has corners of its own.

    Raises:
        CloudFileError: for a binary file of another size than its count of triangles has, and naming the line for a
            text with a corner that is no point, a triangle without three corners, or no end.
    """
    count = int.from_bytes(content[HEADER - 4 : HEADER], "little")
    size = HEADER + count * TRIANGLE.itemsize
    if len(content) >= HEADER and len(content) == size:
        corners = np.frombuffer(content, TRIANGLE, count, HEADER)["corners"].reshape(-1, 3).astype(np.float64)
    elif b"\0" not in content and content.lstrip()[:5].lower() == b"solid":
        corners = _text_corners(content.decode("utf-8", "replace"), path)
    else:
        few = "few" if len(content) < max(size, HEADER) else "many"
        raise CloudFileError(f"{path}: {len(content)} bytes are too {few} for its {count} faces; {AGAIN}")
    return Mesh(corners, np.arange(len(corners)).reshape(-1, 3))


def _text_corners(text: str, path: Path) -> np.ndarray:
    corners, lines, end = [], [], ""
    for line, content in enumerate(text.split("\n"), 1):
        words = content.split()
        if not words:
            continue
        end = words[0].lower()
        if end == "vertex":
            corners.append(words[1:])
            lines.append(line)
        elif end in ("facet", "endfacet", "endsolid") and len(corners) % 3:
            raise CloudFileError(f"{path}:{line}: the triangle above has not three corners; {AGAIN}")
    if end != "endsolid":
        raise CloudFileError(f"{path}: it does not end as an stl file does, with endsolid, but is cut short: {AGAIN}")
    return coordinates(corners, lines, path)
