"""What a cloud is read from: a file, one packed with gzip, or standard input, whose kind shows in its first bytes."""

import gzip
import io
import re
import sys
import zlib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import BinaryIO

from symshrec.scans.cloud import CloudFileError

STDIN, STDIN_NAME = Path("-"), "standard input"
GZIP, GZIP_MAGIC = ".gz", b"\x1f\x8b"
LEAST_BOUND, HIGHEST_RATIO = 1_000_000_000, 100  # bytes; coordinates shrink to a third, or a tenth at most
CHUNK = 1 << 24
BY_FIRST_BYTES = (
    (b"ply", ".ply"),
    (b"\x93NUMPY", ".npy"),
    (b"glTF", ".glb"),
    (b"LASF", ".las"),
    (b"ASTM-E57", ".e57"),
    (b"PAR1", ".parquet"),
    (b"VERSION", ".pcd"),
    (b"solid", ".stl"),
    (b"v ", ".obj"),
    (b"o ", ".obj"),
    (b"mtllib ", ".obj"),
    (b"{", ".gltf"),
)
STL_HEADER, STL_TRIANGLE = 84, 50  # bytes


@dataclass(frozen=True)
class Source:
    """A file's name for errors, its kind as an extension (".ply"), and its bytes where they are not the file's own."""

    path: Path
    kind: str
    content: bytes | None = None

    @cached_property
    def size(self) -> int:
        """Bytes of it, unpacked."""
        return self.path.stat().st_size if self.content is None else len(self.content)

    def open(self) -> BinaryIO:
        """Its bytes as a file."""
        return open(self.path, "rb") if self.content is None else io.BytesIO(self.content)

    def read(self) -> bytes:
        """All its bytes."""
        return self.path.read_bytes() if self.content is None else self.content


def kind_of(path: Path) -> str:
    """The extension in lower case; of `a.csv.gz`, that before `.gz`."""
    kind = path.suffix.lower()
    return Path(path.stem).suffix.lower() if kind == GZIP else kind


def stem_of(path: Path) -> str:
    """A file's name without its extension and `.gz`; "stdin" of standard input."""
    if path == STDIN:
        return "stdin"
    return Path(path.stem).stem if path.suffix.lower() == GZIP else path.stem


def open_source(path: Path) -> Source:
    """A file as it is, or unpacked; `-` is standard input, packed or not.

    Raises:
        CloudFileError: for a packed file that is damaged, or that unpacks to more than `most_unpacked`.
    """
    if path == STDIN:
        content, name = sys.stdin.buffer.read(), Path(STDIN_NAME)
        if content.startswith(GZIP_MAGIC):
            content = unpacked(content, name)
        return Source(name, sniffed(content), content)
    if path.suffix.lower() == GZIP:
        return Source(path, kind_of(path), unpacked(path.read_bytes(), path))
    path.stat()  # a file that is not there comes before a package that is not
    return Source(path, kind_of(path))


def most_unpacked(size: int) -> int:
    """Bytes that a packed file of `size` bytes may take when it is unpacked: few kilobytes can claim any memory."""
    return max(LEAST_BOUND, HIGHEST_RATIO * size)


def unpacked(packed: bytes, path: Path) -> bytes:
    """What was packed with gzip; errors as `open_source`."""
    limit, parts, size = most_unpacked(len(packed)), [], 0
    try:
        with gzip.GzipFile(fileobj=io.BytesIO(packed)) as file:
            while part := file.read(CHUNK):
                parts.append(part)
                size += len(part)
                if size > limit:
                    raise CloudFileError(
                        f"{path}: its {len(packed):,} bytes unpack to more than {limit / 1e9:.3g} GB, which is no "
                        "cloud; if it is one, unpack it first"
                    )
    except (EOFError, OSError, zlib.error) as error:
        raise CloudFileError(f"{path}: it does not unpack ({error}); pack or copy it again") from error
    return b"".join(parts)


def sniffed(content: bytes) -> str:
    """The kind of file that bytes begin like; text where nothing else fits."""
    start = content[:4096].removeprefix(b"\xef\xbb\xbf").lstrip()
    while start.startswith(b"#"):
        start = start.partition(b"\n")[2].lstrip()
    if start.startswith(b"PK"):
        return ".3mf" if b"3dmodel.model" in content.lower() else ".npz"
    if re.match(rb"(ST)?C?N?OFF", start):
        return ".off"
    triangles = int.from_bytes(content[STL_HEADER - 4 : STL_HEADER], "little")
    if len(content) == STL_HEADER + STL_TRIANGLE * triangles:
        return ".stl"
    return next((kind for magic, kind in BY_FIRST_BYTES if start.startswith(magic)), ".txt")
