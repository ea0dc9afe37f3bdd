"""One way to read a cloud, whatever kind of file it is in."""

from pathlib import Path

from symshrec.scans.arrays import read_array
from symshrec.scans.cloud import CloudFileError, FileCloud
from symshrec.scans.meshes import read_mesh
from symshrec.scans.text import read_text

TEXT, ARRAY, MESH = (".txt", ".xyz", ".csv"), (".npy",), (".ply", ".obj", ".off", ".stl")
EXTENSIONS = (*TEXT, *ARRAY, *MESH)
SAMPLES = 20_000  # points on a mesh, unless another number is asked for
MOST_SAMPLES = 10_000_000  # of which memory holds about a gigabyte


def read_cloud(path: str | Path, samples: int = SAMPLES, seed: int = 0) -> FileCloud:
    """The cloud in a file, by its extension.

    Text (txt, xyz, csv): see `read_text`. npy: (N, 3 or more), never unpickled. ply (text or binary), obj, off, stl: a
    file with faces gives points on its surface, one without its vertices.

    Args:
        samples: points to draw on a mesh, 1 to MOST_SAMPLES. seed: of those points, from 0 on.

    Raises:
        ValueError: for `samples` or `seed` out of range.
        CloudFileError: naming the file, the line in text, what is wrong and what to do.
        OSError: where the file is not there or cannot be opened.
    """
    if not 1 <= samples <= MOST_SAMPLES:
        raise ValueError(f"samples is {samples}; it must be from 1 to {MOST_SAMPLES:,}")
    if seed < 0:
        raise ValueError(f"seed is {seed}; it must be 0 or more")
    path = Path(path)
    kind = path.suffix.lower()
    if path.is_dir():
        raise CloudFileError(f"{path}: this is a folder; name a file ({', '.join(EXTENSIONS)})")
    if kind not in EXTENSIONS:
        raise CloudFileError(f"{path}: unknown extension {kind!r}; what can be read: {', '.join(EXTENSIONS)}")
    if kind in TEXT:
        return read_text(path)
    return read_array(path) if kind in ARRAY else read_mesh(path, samples, seed)
