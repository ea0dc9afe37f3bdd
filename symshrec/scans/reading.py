"""One way to read a cloud, whatever kind of file it is in."""

from pathlib import Path

import numpy as np

from symshrec.scans.cloud import CloudFileError, FileCloud, three_columns
from symshrec.scans.meshes import read_mesh
from symshrec.scans.text import read_text

TEXT, ARRAY, MESH = (".txt", ".xyz", ".csv"), (".npy",), (".ply", ".obj", ".off", ".stl")
EXTENSIONS = (*TEXT, *ARRAY, *MESH)
SAMPLES = 20_000  # points on a mesh, unless told


def read_cloud(path: str | Path, samples: int = SAMPLES, seed: int = 0) -> FileCloud:
    """The cloud in a file, by its extension.

    Text (txt, xyz, csv): see `read_text`. npy: (N, 3 or more), never unpickled. ply (text or binary), obj, off, stl: a
    file with faces gives points on its surface, one without its vertices.

    Args:
        samples: points to draw on a mesh. seed: of those points.

    Raises:
        CloudFileError: naming the file, the line in text, what is wrong and what to do.
        OSError: where the file is not there or cannot be opened.
    """
    path = Path(path)
    kind = path.suffix.lower()
    if path.is_dir():
        raise CloudFileError(f"{path}: this is a folder; name a file ({', '.join(EXTENSIONS)})")
    if kind not in EXTENSIONS:
        raise CloudFileError(f"{path}: unknown extension {kind!r}; what can be read: {', '.join(EXTENSIONS)}")
    if kind in TEXT:
        return read_text(path)
    return _read_array(path) if kind in ARRAY else read_mesh(path, samples, seed)


def _read_array(path: Path) -> FileCloud:
    try:
        with open(path, "rb") as file:
            rows = np.lib.format.read_array(file, allow_pickle=False)
    except ValueError as error:
        raise CloudFileError(f"{path}: no array of numbers ({error}); write it with numpy.save") from error
    if rows.dtype.kind not in "fiu":
        raise CloudFileError(f"{path}: the array holds {rows.dtype}; points are real numbers: save them as float64")
    return three_columns(rows, path)
