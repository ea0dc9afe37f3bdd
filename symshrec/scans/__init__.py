"""Anyone's clouds and meshes: what `symshrec detect` and `symshrec view` read."""

from symshrec.scans.cloud import CloudFileError, FileCloud
from symshrec.scans.reading import EXTENSIONS, SAMPLES, read_cloud

__all__ = ["EXTENSIONS", "SAMPLES", "CloudFileError", "FileCloud", "read_cloud"]
