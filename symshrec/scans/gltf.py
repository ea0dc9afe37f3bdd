"""Meshes and points of glTF 2.0, as one glb or as gltf with its buffers, each node placed as the scene has it.

Read here rather than by trimesh, which takes sparse and normalised coordinates for others and leaves triangle fans out
without a word.
"""

import base64
import binascii
import struct
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from symshrec.files.foreign import is_whole, parse_json
from symshrec.scans.accessors import Accessors
from symshrec.scans.cloud import CloudFileError
from symshrec.scans.polygons import Assembly, Mesh

MAGIC, JSON_CHUNK, BINARY_CHUNK = b"glTF", 0x4E4F534A, 0x004E4942
POINTS, TRIANGLES, STRIP, FAN = 0, 4, 5, 6
HARMLESS = ("KHR_materials_", "KHR_texture_", "EXT_texture_", "KHR_lights_", "KHR_mesh_quantization", "KHR_xmp")
AGAIN = "export it again"


def read_gltf(content: bytes, path: Path, most: int) -> Mesh:
    """The mesh of a glb's or gltf's bytes; buffers in files of their own are looked for beside it and nowhere else.

    Args:
        most: bytes that the mesh may take once every node has its copy.

    Raises:
        CloudFileError: for what is no glTF 2.0, an extension without which its geometry cannot be read (such as
            Draco's), a buffer that is not there or lies elsewhere, and what the accessors claim beyond it.
    """
    text, own = _chunks(content, path) if content.startswith(MAGIC) else (content, None)
    try:
        tree = parse_json(text)
    except ValueError as error:
        raise CloudFileError(f"{path}: no glTF ({str(error)[:80]}); {AGAIN}") from error
    try:
        return Scene(tree, own, path, most).mesh()
    except (KeyError, IndexError, TypeError, AttributeError, ValueError, OverflowError) as error:
        if isinstance(error, CloudFileError):
            raise
        raise CloudFileError(
            f"{path}: it is no valid glTF ({type(error).__name__}: {str(error)[:80]}); {AGAIN}"
        ) from error


def _chunks(content: bytes, path: Path) -> tuple[bytes, bytes | None]:
    """The JSON of a glb and its binary chunk."""
    version, length = struct.unpack_from("<II", content.ljust(12, b"\0"), 4)
    if version != 2 or length > len(content):
        raise CloudFileError(
            f"{path}: a glb of version {version} and {length} bytes, of which {len(content)} are there; it should be "
            "version 2 and whole: export or copy it again"
        )
    found: dict[int, bytes] = {}
    at = 12
    while at + 8 <= length:
        size, kind = struct.unpack_from("<II", content, at)
        found.setdefault(kind, content[at + 8 : at + 8 + size])
        at += 8 + size
    return found.get(JSON_CHUNK, b""), found.get(BINARY_CHUNK)


class Scene:
    """The nodes of a glTF, and their meshes in the scene's own coordinates."""

    def __init__(self, tree: Any, own: bytes | None, path: Path, most: int):
        self.path, self.tree = path, tree
        version = str(tree.get("asset", {}).get("version", ""))
        if version.split(".")[0] != "2":
            raise CloudFileError(f"{path}: it is of glTF version {version[:20]!r}, but should be of 2.0; {AGAIN}")
        if needed := [each for each in tree.get("extensionsRequired", []) if not str(each).startswith(HARMLESS)]:
            raise CloudFileError(f"{path}: its geometry needs the extension {str(needed[0])[:60]}; {AGAIN} without it")
        buffers = [self._buffer(each, own if not place else None) for place, each in enumerate(tree.get("buffers", []))]
        self.accessors = Accessors(tree, buffers, path)
        self.assembly = Assembly(path, most)

    def mesh(self) -> Mesh:
        """All meshes of the scene that is shown first; of all nodes where no scene is named."""
        nodes = self.tree.get("nodes", [])
        if scenes := self.tree.get("scenes"):
            roots = _of(scenes, self.tree.get("scene", 0)).get("nodes", [])
        else:
            children = {child for node in nodes for child in node.get("children", [])}
            roots = [place for place in range(len(nodes)) if place not in children]
        queue, seen = [(root, np.eye(4)) for root in roots], set()
        while queue:
            place, above = queue.pop()
            if place in seen:
                raise CloudFileError(f"{self.path}: node {place} hangs below two others, or below itself; {AGAIN}")
            seen.add(place)
            node = _of(nodes, place)
            pose = above @ _pose(node)
            if "mesh" in node:
                self._place(_of(self.tree["meshes"], node["mesh"]), pose)
            queue.extend((child, pose) for child in node.get("children", []))
        return self.assembly.mesh()

    def _place(self, mesh: dict, pose: np.ndarray) -> None:
        for primitive in mesh["primitives"]:
            mode = primitive.get("mode", TRIANGLES)
            if mode not in (POINTS, TRIANGLES, STRIP, FAN):  # lines
                continue
            vertices = self.accessors.values(primitive["attributes"]["POSITION"], "VEC3", self.assembly.room)
            if "indices" in primitive:
                corners = self.accessors.values(primitive["indices"], "SCALAR", self.assembly.room).astype(np.int64)
            else:
                corners = np.arange(len(vertices))
            if mode == POINTS:
                self.assembly.add(vertices, np.zeros((0, 3), np.int64), pose)
            else:
                self.assembly.add(vertices, _triangles(corners.reshape(-1), mode), pose)

    def _buffer(self, buffer: dict, own: bytes | None) -> bytes:
        uri = buffer.get("uri")
        if uri is None:
            if own is None:
                raise CloudFileError(f"{self.path}: one of its buffers names no file and is not in it; {AGAIN}")
            return own
        if uri.startswith("data:"):
            try:
                return base64.b64decode(uri.partition("base64,")[2], validate=True)
            except binascii.Error as error:
                raise CloudFileError(f"{self.path}: a buffer in it is no base64 ({error}); {AGAIN}") from error
        beside = (self.path.parent / unquote(uri)).resolve()
        if not beside.is_relative_to(self.path.parent.resolve()):
            raise CloudFileError(
                f"{self.path}: its buffer {uri[:80]!r} lies outside its folder; put it beside the file"
            )
        if not beside.is_file():
            raise CloudFileError(f"{self.path}: its buffer {uri[:80]!r} is not there; put it beside the file")
        return beside.read_bytes()


def _of(items: list, place: int) -> dict:
    if not is_whole(place, most=len(items) - 1):
        raise IndexError(f"{str(place)[:20]} of {len(items)}")
    return items[place]


def _pose(node: dict) -> np.ndarray:
    """(4, 4): a node's place below the one above it, as a matrix or as scale, rotation (x, y, z, w) and translation."""
    if "matrix" in node:
        return np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
    pose = np.eye(4)
    x, y, z, w = np.array(node.get("rotation", (0, 0, 0, 1)), dtype=np.float64)
    length = x * x + y * y + z * z + w * w
    if not length > 0:
        raise ValueError("a rotation of length zero")
    turn = np.array(
        [
            [y * y + z * z, z * w - x * y, -x * z - y * w],
            [-x * y - z * w, x * x + z * z, x * w - y * z],
            [y * w - x * z, -y * z - x * w, x * x + y * y],
        ]
    )
    pose[:3, :3] = (np.eye(3) - 2 / length * turn) * np.array(node.get("scale", (1, 1, 1)), dtype=np.float64)
    pose[:3, 3] = node.get("translation", (0, 0, 0))
    return pose


def _triangles(corners: np.ndarray, mode: int) -> np.ndarray:
    if mode == TRIANGLES:
        return corners[: len(corners) // 3 * 3].reshape(-1, 3)
    if mode == FAN:
        return np.stack([np.broadcast_to(corners[:1], max(0, len(corners) - 2)), corners[1:-1], corners[2:]], axis=1)
    return np.stack([corners[:-2], corners[1:-1], corners[2:]], axis=1)
