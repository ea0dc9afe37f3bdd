"""Clouds and meshes in ply, obj, off and stl, and points drawn on a mesh's surface."""

import io
import re
from pathlib import Path

import numpy as np

from symshrec.scans.cloud import CloudFileError, FileCloud, refuse_not_finite
from symshrec.scans.ply import bare_vertices

STL_HEADER, STL_TRIANGLE = 84, 50  # bytes of a binary file
EXPORT_AGAIN = "it may be cut short: export or copy it again"


def read_mesh(path: Path, samples: int, seed: int) -> FileCloud:
    """The points of a file without faces, or `samples` points on the surface of one with faces.

    Raises:
        CloudFileError: for a file that is cut short or not what its extension says, without vertices, with a face of a
            vertex that is not there, with coordinates that are not finite, or with a surface of no area.
    """
    kind, content = path.suffix.lower().removeprefix("."), path.read_bytes()
    _refuse_damage(content, kind, path)
    vertices, faces = _parse(content, kind, path)
    if not len(vertices):
        raise CloudFileError(f"{path}: there are no vertices in it; {EXPORT_AGAIN}")
    refuse_not_finite(vertices, path)
    if not len(faces):
        return FileCloud(vertices)
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise CloudFileError(f"{path}: a face has a vertex that is not there; {EXPORT_AGAIN}")
    points = sample_surface(vertices[faces], samples, seed)
    if points is None:
        raise CloudFileError(f"{path}: its {len(faces)} triangles have no area; save its vertices alone as a cloud")
    note = f"a mesh of {len(faces):,} triangles, taken as {samples:,} points drawn evenly on its surface (seed {seed})"
    return FileCloud(points, (note,), len(faces))


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


def _parse(content: bytes, kind: str, path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (V, 3) float64 and triangles (F, 3) int64, each maybe empty; nothing else is opened."""
    if kind == "ply" and (vertices := bare_vertices(content)) is not None:
        return vertices, np.zeros((0, 3), np.int64)
    import trimesh  # nearly a second

    try:
        loaded = trimesh.load(io.BytesIO(content), file_type=kind, process=False, skip_materials=True)
    except Exception as error:  # trimesh raises whatever its parsers come across
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise CloudFileError(f"{path}: it cannot be read as {kind} ({reason}); {EXPORT_AGAIN}") from error
    parts = list(loaded.geometry.values()) if isinstance(loaded, trimesh.Scene) else [loaded]
    vertices = [np.asarray(part.vertices, dtype=np.float64).reshape(-1, 3) for part in parts]
    faces = [np.asarray(getattr(part, "faces", ()), dtype=np.int64).reshape(-1, 3) for part in parts]
    starts = np.cumsum([0, *map(len, vertices)])
    faces = [each + start for each, start in zip(faces, starts, strict=False)]
    return np.concatenate([np.zeros((0, 3)), *vertices]), np.concatenate([np.zeros((0, 3), np.int64), *faces])


def _refuse_damage(content: bytes, kind: str, path: Path) -> None:
    """What trimesh would read as if it were whole, or for which it would ask for another package."""
    if not content.strip():
        raise CloudFileError(f"{path}: the file is empty; {EXPORT_AGAIN}")
    if kind == "ply":
        _refuse_short_ply(content, path)
    elif kind == "stl" and not _is_text(content):
        triangles = int.from_bytes(content[STL_HEADER - 4 : STL_HEADER], "little")
        if len(content) < STL_HEADER or len(content) < STL_HEADER + triangles * STL_TRIANGLE:
            raise CloudFileError(f"{path}: {len(content)} bytes are too few for its {triangles} faces; {EXPORT_AGAIN}")
    elif kind == "stl" and b"endsolid" not in content:
        raise CloudFileError(f"{path}: it does not end as an stl file does, with endsolid; {EXPORT_AGAIN}")
    elif not _is_text(content):
        raise CloudFileError(f"{path}: {kind} is a text format, and this is no text; {EXPORT_AGAIN}")


def _refuse_short_ply(content: bytes, path: Path) -> None:
    header, found, body = content.partition(b"end_header")
    if not content.startswith(b"ply") or not found:
        raise CloudFileError(
            f"{path}: it does not begin as a ply file does; give it its own extension, or export it again"
        )
    if b"format ascii" in header:
        elements = re.findall(rb"^element (\w+) (\d+)", header, flags=re.MULTILINE)
        expected, lines = sum(int(count) for _, count in elements), len(body.split(b"\n")) - 2
        if body.strip() and not body.endswith(b"\n"):
            lines += 1
        if lines < expected:
            raise CloudFileError(f"{path}: {lines} of the {expected} lines that its header counts; {EXPORT_AGAIN}")


def _is_text(content: bytes) -> bool:
    try:
        return "\0" not in content.decode("utf-8")
    except UnicodeDecodeError:
        return False
