"""Anyone's clouds and meshes: what `symshrec detect` and `symshrec view` read."""

from symshrec.clouds.cloud import CloudFileError, FileCloud
from symshrec.clouds.reading import EXTENSIONS, SAMPLES, read_cloud

__all__ = ["EXTENSIONS", "SAMPLES", "CloudFileError", "FileCloud", "read_cloud"]
