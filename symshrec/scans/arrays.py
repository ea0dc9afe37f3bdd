"""Clouds in npy and npz: what a header claims is held against the file before anything of its size is made."""

import io
import math
import zipfile
import zlib
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO

import numpy as np

from symshrec.scans.cloud import AXES, CloudFileError, FileCloud, left_out, readable, refuse_not_finite, three_columns
from symshrec.scans.source import Source, most_unpacked

HEADERS = {(1, 0): (2, np.lib.format.read_array_header_1_0), (2, 0): (4, np.lib.format.read_array_header_2_0)}
LONGEST_HEADER = 10_000  # bytes, as numpy itself has it
LARGEST_NUMBER = 16  # bytes
CLOUD_NAMES = ("points", "xyz", "vertices", "pos", "positions", "coords", "pointcloud", "point_cloud", "pc", "arr_0")


def read_array(source: Source) -> FileCloud:
    """The cloud in an npy file: (N, 3 or more) real numbers, never unpickled.

    Raises:
        CloudFileError: for a header that is none or claims more than the file holds, for anything but real numbers,
            and as `three_columns`.
    """
    with source.open() as file:
        return three_columns(_rows(file, source.size, source.path, source.content is None), source.path)


def read_archive(source: Source) -> FileCloud:
    """The cloud in an npz file: its only (N, 3 or more) array, or the one called points, xyz, vertices or the like; or
    its arrays x, y and z. Nothing is unpickled.

    Raises:
        CloudFileError: for an archive that is damaged, unpacks to more than `most_unpacked` or holds no or several
            clouds, naming its arrays; and as `read_array`.
    """
    path, limit = source.path, most_unpacked(source.size)
    with readable(path, "npz", "write it with numpy.savez"), source.open() as file, zipfile.ZipFile(file) as archive:
        members = {each.filename.removesuffix(".npy"): each for each in archive.infolist()}
        name, chosen = _chosen(archive, members, path)
        if sum(members[each].file_size for each in chosen) > limit:
            raise CloudFileError(f"{path}: its arrays unpack to more than {limit / 1e9:.3g} GB, which is no cloud")
        parts = [archive.read(members[each]) for each in chosen]
    arrays = [
        _rows(io.BytesIO(part), len(part), Path(f"{path}[{key}]")) for key, part in zip(chosen, parts, strict=True)
    ]
    if name:
        cloud = three_columns(arrays[0], Path(f"{path}[{name}]"))
        return FileCloud(cloud.points, (*_others(len(members) - 1, name), *cloud.notes))
    if len({each.shape for each in arrays}) != 1 or arrays[0].ndim != 1 or not len(arrays[0]):
        shapes = ", ".join(str(each.shape) for each in arrays)
        raise CloudFileError(f"{path}: its arrays x, y and z have shapes {shapes}; they should be of one length")
    points = np.stack(arrays, axis=1).astype(np.float64)
    refuse_not_finite(points, path)
    return FileCloud(points, left_out(len(members) - 3))


def _others(count: int, name: str) -> tuple[str, ...]:
    return (f"its array {name!r} taken, {count} more left out",) if count else ()


def _chosen(archive: zipfile.ZipFile, members: dict[str, zipfile.ZipInfo], path: Path) -> tuple[str, list[str]]:
    """The array that is the cloud and its member; or "" and the members x, y and z."""
    shapes: dict[str, tuple[int, ...]] = {}
    for name, member in members.items():
        with archive.open(member) as file, suppress(CloudFileError):  # what is no array of numbers is no cloud
            shape, _, dtype = _header(file, path)
            if dtype.kind in "fiu":
                shapes[name] = shape
    clouds = [name for name, shape in shapes.items() if len(shape) == 2 and shape[1] >= len(AXES)]
    named = [name for wanted in CLOUD_NAMES for name in clouds if name.lower() == wanted]
    if len(clouds) == 1 or named:
        name = named[0] if named else clouds[0]
        return name, [name]
    lower = {name.lower(): name for name in shapes}
    if set(AXES) <= set(lower):
        return "", [lower[axis] for axis in AXES]
    found = ", ".join(f"{name} {shape}" for name, shape in shapes.items())[:200] or "none of numbers"
    how = "several could be the cloud; call it points" if clouds else "none is a cloud; save one (N, 3) as points"
    raise CloudFileError(f"{path}: of its arrays ({found}) {how}")


def _rows(file: BinaryIO, size: int, path: Path, on_disk: bool = False) -> np.ndarray:
    """The array in a file of `size` bytes, as its header describes it."""
    shape, by_columns, dtype = _header(file, path)
    if len(shape) > 2:
        raise CloudFileError(f"{path}: the array has shape {str(shape)[:60]}; a cloud is (N, 3), one row a point")
    if dtype.kind not in "fiu" or dtype.itemsize > LARGEST_NUMBER:
        raise CloudFileError(f"{path}: the array holds {dtype}; points are real numbers: save them as float64")
    count, there = math.prod(shape), size - file.tell()
    if count * dtype.itemsize > there:
        raise CloudFileError(
            f"{path}: its header claims shape {str(shape)[:60]} of {dtype}, but only {there} bytes follow; it may "
            "be cut short: copy or save it again"
        )
    rows = np.fromfile(file, dtype, count) if on_disk else np.frombuffer(file.read(count * dtype.itemsize), dtype)
    return rows.reshape(shape[::-1]).T if by_columns else rows.reshape(shape)


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
    except (zipfile.BadZipFile, zlib.error):
        raise
    except Exception as error:  # numpy's parser passes on whatever Python's own raises
        reason = " ".join(str(error).split())[:120] or type(error).__name__
        raise CloudFileError(f"{path}: no array of numbers ({reason}); write it with numpy.save") from error
    if any(isinstance(length, bool) or length < 0 for length in shape):
        raise CloudFileError(f"{path}: the array has shape {str(shape)[:60]}; a cloud is (N, 3), one row a point")
    return shape, by_columns, dtype
