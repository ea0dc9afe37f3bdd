"""Clouds and meshes out: ply, xyz, obj, stl and npy, whole or not at all."""

import io
from pathlib import Path

import numpy as np

from symshrec.files.atomic import write_atomically
from symshrec.scans.stl import HEADER, TRIANGLE

WITH_FACES = (".ply", ".obj", ".stl")
WITHOUT_FACES = (".ply", ".xyz", ".obj", ".npy")
DIGITS = 12  # significant, of coordinates in text


def check_writable(path: Path, faces: bool) -> None:
    """Refuse a file that cannot be written, before any work is done.

    Args:
        faces: whether a mesh is to be written.

    Raises:
        ValueError: for an extension that is unknown or cannot hold this, and for a folder in its place.
    """
    kind, can = path.suffix.lower(), WITH_FACES if faces else WITHOUT_FACES
    if kind not in can:
        if kind in WITH_FACES + WITHOUT_FACES:
            raise ValueError(f"{path}: {kind} cannot hold {'faces' if faces else 'points'}; write {', '.join(can)}")
        raise ValueError(f"{path}: unknown extension {kind!r}; what can be written: {', '.join(can)}")
    if path.is_dir():
        raise ValueError(f"{path} is a folder; name a file")


def write_shape(
    path: Path, points: np.ndarray, triangles: np.ndarray | None = None, values: dict[str, np.ndarray] | None = None
) -> None:
    """Write points, or a mesh, in the format of the file's extension; in double precision, but stl in single.

    Args:
        points: (N, 3). triangles: (F, 3) places among them; None or empty for a cloud.
        values: further properties of the points, each (N,), by name; ply alone keeps them.

    Raises:
        ValueError: as `check_writable`.
    """
    faces = np.zeros((0, 3), dtype=np.int64) if triangles is None else np.asarray(triangles)
    check_writable(path, bool(len(faces)))
    points = np.asarray(points, dtype=np.float64)
    kind = path.suffix.lower()
    if kind == ".ply":
        content = _ply(points, faces, values or {})
    elif kind == ".npy":
        file = io.BytesIO()
        np.save(file, points, allow_pickle=False)
        content = file.getvalue()
    elif kind == ".stl":
        content = _stl(points, faces)
    else:
        content = _text(points, faces, "v " if kind == ".obj" else "")
    write_atomically(path, content)


def _ply(points: np.ndarray, faces: np.ndarray, values: dict[str, np.ndarray]) -> bytes:
    names = ["x", "y", "z", *values]
    rows = np.empty(len(points), dtype=[(name, "<f8" if name in ("x", "y", "z") else "<f4") for name in names])
    for name, column in zip(names, [*points.T, *values.values()], strict=True):
        rows[name] = column
    kinds = [f"property {'double' if name in ('x', 'y', 'z') else 'float'} {name}" for name in names]
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {len(points)}", *kinds]
    corners = np.empty(len(faces), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    corners["count"], corners["corners"] = 3, faces
    if len(faces):
        head += [f"element face {len(faces)}", "property list uchar int vertex_indices"]
    return "\n".join([*head, "end_header", ""]).encode() + rows.tobytes() + corners.tobytes()


def _stl(points: np.ndarray, faces: np.ndarray) -> bytes:
    rows = np.zeros(len(faces), dtype=TRIANGLE)
    corners = points[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    rows["corners"], rows["normal"] = corners, normals / np.where(lengths > 0, lengths, 1)
    return b"symshrec".ljust(HEADER - 4) + len(faces).to_bytes(4, "little") + rows.tobytes()


def _text(points: np.ndarray, faces: np.ndarray, mark: str) -> bytes:
    file = io.BytesIO()
    np.savetxt(file, points, fmt=f"{mark}%.{DIGITS}g %.{DIGITS}g %.{DIGITS}g")
    np.savetxt(file, faces + 1, fmt="f %d %d %d")
    return file.getvalue()
