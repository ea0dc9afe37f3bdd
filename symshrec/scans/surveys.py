"""Clouds that other packages read: las and laz (laspy), e57 (pye57), of the extra `scan`, and parquet (pyarrow)."""

import struct
from importlib import import_module
from pathlib import Path
from tempfile import NamedTemporaryFile
from types import ModuleType
from typing import Any, BinaryIO

import numpy as np

from symshrec.scans.cloud import AXES, CloudFileError, FileCloud, axis_places, left_out, readable, refuse_not_finite
from symshrec.scans.source import Source, most_unpacked

CHUNK = 1_000_000  # points
POINT = 24  # bytes of x, y, z in double precision
LAS_HEADER, LAS_RECORD, LAZ_FORMATS, LEAST_CHUNK = 227, 54, 0x80, 8  # bytes; packed points have the highest bit
AGAIN = "it may be cut short: export or copy it again"


def read_las(source: Source) -> FileCloud:
    """The points of a las or laz file, scaled and moved as its header says, in double precision.

    Raises:
        CloudFileError: where laspy, or lazrs for laz, is missing, naming the extra; for a file that laspy cannot read,
            that claims more points than a file of its size holds, or without points.
    """
    path = source.path
    laspy = required("laspy", "scan", source)
    required("lazrs", "scan", source)
    backend = laspy.LazBackend.Lazrs  # the one that works in parallel ends Python itself where chunks claim too much
    with readable(path, "las", AGAIN), source.open() as file:
        _refuse_absurd_las(file, source, path)
        with laspy.open(file, closefd=False, laz_backend=backend, read_evlrs=False) as scan:
            _refuse_absurd(scan.header.point_count, source, path)
            parts = [np.stack([each.x, each.y, each.z], axis=1) for each in scan.chunk_iterator(CHUNK)]
            if sum(map(len, parts)) != scan.header.point_count:
                raise CloudFileError(
                    f"{path}: it has not the {scan.header.point_count:,} points that it claims; {AGAIN}"
                )
    return _whole(parts, path)


def _refuse_absurd_las(file: BinaryIO, source: Source, path: Path) -> None:
    """Hold against the file what laspy and lazrs believe: how many records follow the header, and how many chunks."""
    header = file.read(LAS_HEADER)
    if len(header) < LAS_HEADER or not header.startswith(b"LASF"):
        raise CloudFileError(f"{path}: it does not begin as a las file does; {AGAIN}")
    header_size, start, records, kind = struct.unpack_from("<HIIB", header, 94)
    if start > source.size or records * LAS_RECORD > start - header_size:
        raise CloudFileError(f"{path}: it claims {records:,} records before byte {start:,}, which it has not; {AGAIN}")
    if kind & LAZ_FORMATS:
        file.seek(start)
        at = int.from_bytes(file.read(8), "little")
        if at == 2**64 - 1:  # not known when it was written, and given at its end
            file.seek(max(0, source.size - 8))
            at = int.from_bytes(file.read(8), "little")
        file.seek(at if at + 8 <= source.size else max(0, source.size - 8))
        chunks = int.from_bytes(file.read(8)[4:], "little")
        if at + 8 > source.size or chunks * LEAST_CHUNK > source.size:
            raise CloudFileError(f"{path}: it claims {chunks:,} chunks at byte {at:,}, which it has not; {AGAIN}")
    file.seek(0)


def read_e57(source: Source) -> FileCloud:
    """The points of all scans of an e57 file, each in its place; places that it marks as invalid are left out.

    Raises:
        CloudFileError: as `read_las`, for pye57.
    """
    path = source.path
    pye57 = required("pye57", "scan", source)
    if source.content is not None:  # of standard input, or unpacked
        with NamedTemporaryFile(suffix=".e57") as file:
            file.write(source.content)
            file.flush()
            return _scans(pye57, Path(file.name), source)
    return _scans(pye57, path, source)


def _scans(pye57: ModuleType, place: Path, source: Source) -> FileCloud:
    path, parts, missing = source.path, [], 0
    with readable(path, "e57", AGAIN), pye57.E57(str(place)) as file:
        counts = [file.get_header(scan).point_count for scan in range(file.scan_count)]
        _refuse_absurd(sum(counts), source, path)
        for scan, count in enumerate(counts):
            columns = file.read_scan(scan, ignore_missing_fields=True) if count else {}
            points = [columns.get(f"cartesian{axis.upper()}", np.zeros(0)) for axis in AXES]
            parts.append(np.stack(points, axis=1).astype(np.float64))
            missing += count - len(parts[-1])
    notes = (f"its {len(parts)} scans taken together",) if len(parts) > 1 else ()
    return _whole(parts, path, (*notes, *_without_measurement(missing)))


def _without_measurement(count: int) -> tuple[str, ...]:
    return (f"{count:,} places without a measurement left out",) if count else ()


def read_parquet(source: Source) -> FileCloud:
    """The columns x, y and z of a parquet file, or its first three where none is called so.

    Raises:
        CloudFileError: where pyarrow is missing, naming the extra; for a file that it cannot read, that claims more
            rows than a file of its size holds, or without three columns of real numbers.
    """
    path = source.path
    parquet = required("pyarrow.parquet", "parquet", source)
    with readable(path, "parquet", AGAIN), source.open() as opened, parquet.ParquetFile(opened) as file:
        _refuse_absurd(file.metadata.num_rows, source, path)
        schema = file.schema_arrow
        places = axis_places(schema.names) or tuple(range(len(AXES)))
        if len(schema.names) < len(AXES):
            raise CloudFileError(f"{path}: its columns are {', '.join(schema.names)[:80]}; points need x, y and z")
        names = [schema.names[place] for place in places]
        for name in names:
            _refuse_no_number(name, schema, path)
        batches = file.iter_batches(CHUNK, columns=names)
        parts = [np.stack([_column(each, name) for name in names], axis=1) for each in batches]
    return _whole(parts, path, left_out(len(schema.names) - len(AXES)))


def _column(batch: Any, name: str) -> np.ndarray:
    return batch.column(name).to_numpy(zero_copy_only=False).astype(np.float64)


def _refuse_no_number(name: str, schema: Any, path: Path) -> None:
    kind = str(schema.field(name).type)
    if not kind.startswith(("float", "double", "halffloat", "int", "uint", "decimal")):
        raise CloudFileError(f"{path}: its column {name[:40]!r} holds {kind[:40]}; coordinates are real numbers")


def required(module: str, extra: str, source: Source) -> ModuleType:
    """A package that only some installs have.

    Raises:
        CloudFileError: where it is missing, naming the extra that brings it.
    """
    try:
        return import_module(module)
    except ImportError as error:
        raise CloudFileError(
            f"{source.path}: {source.kind} needs {module.partition('.')[0]}, which is not installed: "
            f"pip install 'symshrec[{extra}]'"
        ) from error


def _refuse_absurd(count: int, source: Source, path: Path) -> None:
    if count * POINT > most_unpacked(source.size):
        raise CloudFileError(
            f"{path}: it claims {count:,} points, which no file of {source.size:,} bytes holds; {AGAIN}"
        )


def _whole(parts: list[np.ndarray], path: Path, notes: tuple[str, ...] = ()) -> FileCloud:
    points = np.concatenate([np.zeros((0, len(AXES))), *parts])
    if not len(points):
        raise CloudFileError(f"{path}: there are no points in it; {AGAIN}")
    refuse_not_finite(points, path)
    return FileCloud(points, notes)
