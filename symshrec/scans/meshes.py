"""Clouds and meshes in ply, obj, off, stl, gltf, glb and 3mf, and points drawn on a mesh's surface."""

from pathlib import Path

import numpy as np

from symshrec.scans.cloud import CloudFileError, FileCloud, refuse_not_finite
from symshrec.scans.gltf import read_gltf
from symshrec.scans.obj import read_obj
from symshrec.scans.off import read_off
from symshrec.scans.ply import read_ply
from symshrec.scans.polygons import Mesh
from symshrec.scans.source import Source, most_unpacked
from symshrec.scans.stl import read_stl
from symshrec.scans.threemf import read_3mf

EXPORT_AGAIN = "it may be cut short: export or copy it again"


def read_mesh(source: Source, samples: int, seed: int) -> FileCloud:
    """The points of a file without faces, or `samples` points on the surface of one with faces.

    Raises:
        CloudFileError: for a file that is cut short or not what its extension says, without vertices, with coordinates
            that are not finite, with a face of too few vertices or of one that is not there, or with a surface of no
            area.
    """
    path = source.path
    mesh = _parse(source.read(), source.kind.removeprefix("."), path)
    if not len(mesh.vertices):
        raise CloudFileError(f"{path}: there are no vertices in it; {EXPORT_AGAIN}")
    refuse_not_finite(mesh.vertices, path)
    vertices, faces = mesh
    if not len(faces):
        return FileCloud(vertices)
    points = sample_surface(vertices[faces], samples, seed)
    if points is None:
        raise CloudFileError(f"{path}: its {len(faces)} triangles have no area; save its vertices alone as a cloud")
    note = f"a mesh of {len(faces):,} triangles, taken as {samples:,} points drawn evenly on its surface (seed {seed})"
    return FileCloud(points, (note,), len(faces), mesh)


def sample_surface(triangles: np.ndarray, count: int, seed: int) -> np.ndarray | None:
    """Points on triangles (F, 3, 3), uniform by area: (count, 3); None where there is no area.

    The surface is cut into `count` pieces of one area and each gives a point, so that the density is more even than
    that of independent points. The same arguments give the same points.
    """
    first, second = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    scale = max(np.abs(first).max(), np.abs(second).max()) or 1.0
    areas = np.cumsum(np.linalg.norm(np.cross(first / scale, second / scale), axis=1))
    if not areas[-1] > 0:
        return None
    generator = np.random.default_rng(seed)
    places = (np.arange(count) + generator.random(count)) / count * areas[-1]
    chosen = np.searchsorted(areas, places, side="right").clip(max=len(areas) - 1)
    a, b = generator.random((2, count, 1))
    outside = a + b > 1  # the other half of the parallelogram, folded back
    a, b = np.where(outside, 1 - a, a), np.where(outside, 1 - b, b)
    return triangles[chosen, 0] + a * first[chosen] + b * second[chosen]


def _parse(content: bytes, kind: str, path: Path) -> Mesh:
    """Vertices and triangles; nothing else is opened, but a gltf's buffers beside it."""
    if not content.strip():
        raise CloudFileError(f"{path}: the file is empty; {EXPORT_AGAIN}")
    if kind in ("ply", "stl"):
        return read_ply(content, path) if kind == "ply" else read_stl(content, path)
    if kind in ("glb", "gltf"):
        return read_gltf(content, path, most_unpacked(len(content)))
    if kind == "3mf":
        return read_3mf(content, path, most_unpacked(len(content)))
    if b"\0" in content:
        raise CloudFileError(f"{path}: {kind} is a text format, and this is no text; {EXPORT_AGAIN}")
    text = content.decode("utf-8-sig", "replace")
    return read_obj(text, path) if kind == "obj" else read_off(text, path)
