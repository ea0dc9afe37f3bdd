"""Anyone's clouds and meshes: what `symshrec detect` and `symshrec view` read."""

from symshrec.scans.cloud import CloudFileError, FileCloud
from symshrec.scans.formats import EXTENSIONS, is_known, listed
from symshrec.scans.reading import MOST_SAMPLES, SAMPLES, read_cloud
from symshrec.scans.source import STDIN, STDIN_NAME, stem_of

__all__ = [
    "EXTENSIONS",
    "MOST_SAMPLES",
    "SAMPLES",
    "STDIN",
    "STDIN_NAME",
    "CloudFileError",
    "FileCloud",
    "is_known",
    "listed",
    "read_cloud",
    "stem_of",
]
