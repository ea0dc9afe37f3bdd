"""Vertices and faces of Wavefront obj; everything else in it (normals, textures, groups, materials) is passed over."""

from collections.abc import Iterator
from pathlib import Path

from symshrec.scans.cloud import CloudFileError
from symshrec.scans.polygons import Mesh, coordinates, of_polygons, whole_numbers


def read_obj(text: str, path: Path) -> Mesh:
    """The mesh of an obj's text.

    A face names vertices from 1 on, or backwards from the last one above it by negative numbers.

    Raises:
        CloudFileError: naming the line, for a vertex without three numbers and a face with a vertex that is not there.
    """
    vertices, places, faces, lines = [], [], [], []
    for line, words in _statements(text):
        if words[0] == "v":
            vertices.append(words[1:4])
            places.append(line)
        elif words[0] in ("f", "fo"):
            faces.append(_corners(words[1:], len(vertices), line, path))
            lines.append(line)
    return Mesh(coordinates(vertices, places, path), of_polygons(faces, lines, len(vertices), path))


def _corners(words: list[str], above: int, line: int, path: Path) -> list[int]:
    """Corners such as 7, 7/1, 7//3 or -1 as places from 0 on."""
    indices = whole_numbers([word.split("/", 1)[0] for word in words], line, path)
    for index in indices:
        if index == 0 or index < -above:
            raise CloudFileError(f"{path}:{line}: a face has vertex {str(index)[:40]}, which is not there")
    return [index - 1 if index > 0 else above + index for index in indices]


def _statements(text: str) -> Iterator[tuple[int, list[str]]]:
    """Words of every line that has some, with its number; a line that ends with \\ goes on in the next."""
    begun, first = "", 1
    for line, content in enumerate(text.split("\n"), 1):
        content = begun + content.split("#", 1)[0].rstrip()
        first = first if begun else line
        if content.endswith("\\"):
            begun = content[:-1] + " "
            continue
        begun, words = "", content.split()
        if words:
            yield first, words
