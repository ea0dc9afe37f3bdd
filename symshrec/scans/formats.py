"""The kinds of files that are read: the one list that help, errors and folders share."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

from symshrec.scans.arrays import read_archive, read_array
from symshrec.scans.cloud import FileCloud
from symshrec.scans.meshes import read_mesh
from symshrec.scans.pcd import read_pcd
from symshrec.scans.source import GZIP, STDIN, Source, kind_of
from symshrec.scans.surveys import read_e57, read_las, read_parquet
from symshrec.scans.text import read_text

Reader = Callable[[Source], FileCloud]
CLOUDS: dict[str, Reader] = {
    **dict.fromkeys((".txt", ".xyz", ".csv", ".pts", ".asc"), read_text),
    ".npy": read_array,
    ".npz": read_archive,
    ".pcd": read_pcd,
    ".las": read_las,
    ".laz": read_las,
    ".e57": read_e57,
    ".parquet": read_parquet,
}
MESHES = (".ply", ".obj", ".off", ".stl", ".glb", ".gltf", ".3mf")  # or points, where a file has no faces
EXTRAS = {".las": "scan", ".laz": "scan", ".e57": "scan", ".parquet": "parquet"}
EXTENSIONS = (*CLOUDS, *MESHES)


def reader_of(kind: str, samples: int, seed: int) -> Reader:
    """What reads a kind of file; `samples` points are drawn on a mesh."""
    return CLOUDS[kind] if kind in CLOUDS else partial(read_mesh, samples=samples, seed=seed)


def is_known(path: Path) -> bool:
    """Whether a file's name ends as one that can be read does, packed or not; `-` is standard input."""
    return path == STDIN or kind_of(path) in EXTENSIONS


def listed() -> str:
    """All that can be read, for help and errors."""
    plain = ", ".join(kind for kind in EXTENSIONS if kind not in EXTRAS)
    extras = "; ".join(
        f"with 'symshrec[{extra}]' {', '.join(kind for kind in EXTRAS if EXTRAS[kind] == extra)}"
        for extra in dict.fromkeys(EXTRAS.values())
    )
    return f"{plain}; {extras}; each also packed as {GZIP}, and from standard input, which is called {STDIN}"
