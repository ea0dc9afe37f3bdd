"""Meshes of 3mf, 3D printing's format: a zip archive of XML, put together as its build items and components say.

Read here rather than by trimesh, which needs lxml for it and follows components along every path, however many.
"""

import io
import zipfile
from array import array
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO
from xml.parsers import expat

import numpy as np

from symshrec.scans.cloud import CloudFileError, readable
from symshrec.scans.polygons import Assembly, Mesh, number

MODEL, ENDING = "3d/3dmodel.model", ".model"
MOST_PARTS = 100_000
AGAIN = "export or copy it again"
Key = tuple[str, str]  # a model's name in the archive and an object's id in it


@dataclass
class Part:
    """An object: its mesh, flat, and the objects that it is made of with their places."""

    vertices: array = field(default_factory=lambda: array("d"))
    triangles: array = field(default_factory=lambda: array("q"))
    components: list[tuple[Key, np.ndarray]] = field(default_factory=list)


def read_3mf(content: bytes, path: Path, most: int) -> Mesh:
    """The mesh of a 3mf file in its own unit: every item of its build, each object in its place.

    Args:
        most: bytes that the archive may unpack to, and that the mesh may take once every item has its copy.

    Raises:
        CloudFileError: for an archive that is damaged, without a model, or unpacks to more; naming model and line for
            XML that is none, and for a vertex or triangle without its numbers; for objects that are not there.
    """
    parts: dict[Key, Part] = {}
    items: list[tuple[Key, np.ndarray]] = []
    with readable(path, "3mf", AGAIN), zipfile.ZipFile(io.BytesIO(content)) as archive:
        models = {each.filename.lstrip("/").lower(): each for each in archive.infolist()}
        models = {name: each for name, each in models.items() if name.endswith(ENDING)}
        if sum(each.file_size for each in models.values()) > most:
            raise CloudFileError(f"{path}: it unpacks to more than {most / 1e9:.3g} GB; {AGAIN}")
        for name, member in models.items():
            model = Model(name, Path(f"{path}[{name}]"))
            with archive.open(member) as file:
                model.parse(file)
            parts.update(model.parts)
            items += model.items if name == MODEL else []
    if MODEL not in models:
        raise CloudFileError(f"{path}: there is no {MODEL} in it, so that it is no 3mf; {AGAIN}")
    return _assembled(parts, items, Assembly(path, most))


def _assembled(parts: dict[Key, Part], items: list[tuple[Key, np.ndarray]], assembly: Assembly) -> Mesh:
    queue, done = [(key, pose, 1) for key, pose in items], 0
    while queue:
        key, pose, depth = queue.pop()
        done += 1
        if key not in parts:
            raise CloudFileError(f"{assembly.path}: its object {key[1][:40]!r} is not there; {AGAIN}")
        if done > MOST_PARTS or depth > len(parts):
            raise CloudFileError(f"{assembly.path}: its objects are made of each other without end; {AGAIN}")
        part = parts[key]
        if part.vertices:
            vertices, triangles = (np.array(each).reshape(-1, 3) for each in (part.vertices, part.triangles))
            assembly.add(vertices, triangles, pose)
        queue.extend((below, pose @ place, depth + 1) for below, place in part.components)
    return assembly.mesh()


class Model:
    """One model of the archive: the parts and build items that its XML has."""

    def __init__(self, name: str, path: Path):
        self.name, self.path = name, path
        self.parts: dict[Key, Part] = {}
        self.items: list[tuple[Key, np.ndarray]] = []
        self._part = Part()
        self._parser = expat.ParserCreate()
        self._parser.StartElementHandler = self._element
        self._parser.StartDoctypeDeclHandler = self._refuse

    def parse(self, file: IO[bytes]) -> None:
        """Read the XML; errors as `read_3mf`."""
        try:
            self._parser.ParseFile(file)
        except expat.ExpatError as error:
            raise CloudFileError(f"{self.path}:{error.lineno}: no XML ({error}); {AGAIN}") from error

    def _element(self, name: str, found: dict[str, str]) -> None:
        match name.rpartition(":")[2]:
            case "vertex":
                self._part.vertices.extend(self._numbers(found, ("x", "y", "z"), float))
            case "triangle":
                corners = self._numbers(found, ("v1", "v2", "v3"), int)
                try:
                    self._part.triangles.extend(corners)
                except OverflowError:
                    raise CloudFileError(
                        f"{self.path}:{self._line}: a triangle has a vertex that is not there"
                    ) from None
            case "object":
                self._part = self.parts[self.name, found.get("id", "")] = Part()
            case "component":
                self._part.components.append(self._placed(found))
            case "item":
                self.items.append(self._placed(found))

    def _placed(self, found: dict[str, str]) -> tuple[Key, np.ndarray]:
        """The object that is meant, and its place: three rows that turn and scale, one that moves."""
        model = next((value for key, value in found.items() if key.rpartition(":")[2] == "path"), self.name)
        pose = np.eye(4)
        if words := dict(enumerate(found.get("transform", "").split())):
            if len(words) != 12:
                raise CloudFileError(f"{self.path}:{self._line}: a transform has {len(words)} numbers, but needs 12")
            pose[:3] = np.array(self._numbers(words, range(12), float)).reshape(4, 3).T
        return (model.lstrip("/").lower(), found.get("objectid", "")), pose

    def _numbers(self, found: Mapping, names: Iterable, kind: type) -> list:
        try:
            return [kind(found[name]) for name in names]
        except (KeyError, ValueError):
            return [number(found.get(name, ""), self._line, self.path, kind) for name in names]

    @property
    def _line(self) -> int:
        return self._parser.CurrentLineNumber

    def _refuse(self, *_) -> None:
        raise CloudFileError(f"{self.path}:{self._line}: it declares a document type, which 3mf has not; {AGAIN}")
