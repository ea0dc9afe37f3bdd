"""Clouds in npy: what the header claims is held against the file before anything of its size is made."""

import io
import math
import os
from pathlib import Path

import numpy as np

from symshrec.scans.cloud import CloudFileError, FileCloud, three_columns

HEADERS = {(1, 0): (2, np.lib.format.read_array_header_1_0), (2, 0): (4, np.lib.format.read_array_header_2_0)}
LONGEST_HEADER = 10_000  # bytes, as numpy itself has it
LARGEST_NUMBER = 16  # bytes


def read_array(path: Path) -> FileCloud:
    """The cloud in an npy file: (N, 3 or more) real numbers, never unpickled.

    Raises:
        CloudFileError: for a header that is none or claims more than the file holds, for anything but real numbers,
            and as `three_columns`.
    """
    with open(path, "rb") as file:
        shape, by_columns, dtype = _header(file, path)
        if dtype.kind not in "fiu" or dtype.itemsize > LARGEST_NUMBER:
            raise CloudFileError(f"{path}: the array holds {dtype}; points are real numbers: save them as float64")
        count, there = math.prod(shape), os.fstat(file.fileno()).st_size - file.tell()
        if count * dtype.itemsize > there:
            raise CloudFileError(
                f"{path}: its header claims shape {str(shape)[:60]} of {dtype}, but only {there} bytes follow; it may "
                "be cut short: copy or save it again"
            )
        rows = np.fromfile(file, dtype, count)
    return three_columns(rows.reshape(shape[::-1]).T if by_columns else rows.reshape(shape), path)


def _header(file, path: Path) -> tuple[tuple[int, ...], bool, np.dtype]:
    """Shape, whether columns come first, and type; the file is left at the first number."""
    try:
        version = np.lib.format.read_magic(file)
        if version not in HEADERS:
            raise ValueError(f"version {version} is for arrays that hold no points")
        width, read = HEADERS[version]
        length = file.read(width)
        size = int.from_bytes(length, "little")
        if size > LONGEST_HEADER:
            raise ValueError(f"a header of {size} bytes")
        shape, by_columns, dtype = read(io.BytesIO(length + file.read(size)))
    except Exception as error:  # numpy's parser passes on whatever Python's own raises
        reason = " ".join(str(error).split())[:120] or type(error).__name__
        raise CloudFileError(f"{path}: no array of numbers ({reason}); write it with numpy.save") from error
    if any(isinstance(length, bool) or length < 0 for length in shape) or len(shape) > 2:
        raise CloudFileError(f"{path}: the array has shape {str(shape)[:60]}; a cloud is (N, 3), one row a point")
    return shape, by_columns, dtype
