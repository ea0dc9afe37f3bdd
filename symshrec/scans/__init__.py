"""Anyone's clouds and meshes: what `symshrec detect` and `symshrec view` read."""

from symshrec.scans.cloud import CloudFileError, FileCloud
from symshrec.scans.reading import EXTENSIONS, MOST_SAMPLES, SAMPLES, read_cloud

__all__ = ["EXTENSIONS", "MOST_SAMPLES", "SAMPLES", "CloudFileError", "FileCloud", "read_cloud"]
