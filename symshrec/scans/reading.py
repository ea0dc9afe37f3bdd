"""One way to read a cloud, whatever kind of file it is in."""

from pathlib import Path

from symshrec.scans.cloud import CloudFileError, FileCloud
from symshrec.scans.formats import is_known, listed, reader_of
from symshrec.scans.source import kind_of, open_source

SAMPLES = 20_000  # points on a mesh, unless another number is asked for
MOST_SAMPLES = 10_000_000  # of which memory holds about a gigabyte


def read_cloud(path: str | Path, samples: int = SAMPLES, seed: int = 0) -> FileCloud:
    """The cloud in a file, by its extension, or in standard input, by its first bytes; in the file's own units.

    `symshrec.scans.formats` lists what is read, and each of its readers says how. A file with faces gives points on its
    surface, placed as its scene has them; one without gives its points. Nothing is unpickled.

    Args:
        path: `-` is standard input; `.gz` after the extension is unpacked.
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
    if path.is_dir():
        raise CloudFileError(f"{path}: this is a folder; name a file ({listed()})")
    if not is_known(path):
        raise CloudFileError(f"{path}: unknown extension {kind_of(path)!r}; what can be read: {listed()}")
    source = open_source(path)
    return reader_of(source.kind, samples, seed)(source)
