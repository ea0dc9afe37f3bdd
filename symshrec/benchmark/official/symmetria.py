"""The files of the benchmark's successor, Symmetria: xz-compressed points, labelled symmetries, labels in the name."""

import lzma
import re
from pathlib import Path

import numpy as np

from symshrec.benchmark.cloud import ALL_FAMILIES, PERTURBATIONS, UNKNOWN, Labels
from symshrec.benchmark.official.numbers import LONGEST_QUOTE, check_count, complaint, parse_rows, split_count
from symshrec.benchmark.official.text import (
    PLANE_COLUMNS,
    counted_text,
    parse_points,
    plane_lines,
    planes_of,
    points_text,
)
from symshrec.files.atomic import write_atomically
from symshrec.planes import Planes

FAMILY_NAMES = {family: family for family in ALL_FAMILIES} | {"lemniscate_bernoulli": "lemniscate"}
PERTURBATION_NAMES = dict(
    zip(
        PERTURBATIONS,
        (
            *("clean", "uniform", "gaussian", "undersampling", "undersampling+uniform", "undersampling+gaussian"),
            *("partial", "strongnoise", "outliers", "fewpoints"),  # ours, which the successor has not; so are these:
            *("uneven", "onesided", "singleview", "cut", "floor", "bent"),
        ),
        strict=True,
    )
)
MOST_TEXT = 100_000_000  # bytes, three million points: hundreds of times the largest cloud of the benchmark
MOST_MEMORY = 200_000_000  # bytes that the decompressor may take; xz at its strongest takes a third
FASTEST = 1  # of lzma's presets: a third of the default's time for files a sixth larger


def _key(name: str) -> str:
    """A name without case and separators, so that "EggKeplero" and "egg_keplero" are one."""
    return re.sub(r"[^a-z0-9]", "", name.lower())


def _either_order(name: str) -> tuple[str, str]:
    return name, "+".join(reversed(name.split("+")))


FAMILY_OF = {_key(name): family for family in ALL_FAMILIES for name in (family, FAMILY_NAMES[family])}
PERTURBATION_OF = {
    _key(name): code for code in PERTURBATIONS for name in (code, *_either_order(PERTURBATION_NAMES[code]))
}


def labels_of(family: str, perturbation: str) -> Labels:
    """Labels from the two words of a file name; the successor's own further classes are UNKNOWN to us."""
    return Labels(
        family=FAMILY_OF.get(_key(family), UNKNOWN),
        perturbation=PERTURBATION_OF.get(_key(perturbation), UNKNOWN),
    )


def class_of(labels: Labels) -> str:
    """The successor's name for a family."""
    return FAMILY_NAMES.get(labels.family, UNKNOWN)


def stem_of(cloud_id: int, labels: Labels) -> str:
    """`NNNNNN-<class>-<perturbation>`, from which `labels_of` gives the same family and perturbation."""
    return f"{cloud_id:06d}-{class_of(labels)}-{PERTURBATION_NAMES.get(labels.perturbation, UNKNOWN)}"


def read_compressed_points(path: Path) -> np.ndarray:
    """The cloud of a `.xz` file: (N, 3) float64, as it stands there.

    Raises:
        OfficialFileError: for a file that does not unpack or is too large when it does, and as
            `text.read_points` for what is in it.
    """
    return parse_points(_unpacked(Path(path)), path)


def _unpacked(path: Path) -> bytes:
    """The text in an xz file, MOST_TEXT at most: a forged file of a few kilobytes could fill any memory."""
    text, packed = b"", path.read_bytes()
    try:
        while packed.strip(b"\0") or not text:  # several streams may follow each other, with zeros between
            stream = lzma.LZMADecompressor(memlimit=MOST_MEMORY)
            text += stream.decompress(packed, max_length=MOST_TEXT + 1 - len(text))
            if len(text) > MOST_TEXT:
                raise complaint(path, 1, f"the file unpacks to more than {MOST_TEXT / 1e6:.0f} MB, which is no cloud")
            if not stream.eof:
                raise EOFError("it ends before its end marker")
            packed = stream.unused_data
    except (lzma.LZMAError, EOFError) as error:
        raise complaint(path, 1, f"the file does not unpack ({error}); fetch it again") from error
    return text


def write_compressed_points(path: Path, points: np.ndarray) -> None:
    """Write (N, 3) points as xz-compressed text, whole or not at all."""
    write_atomically(Path(path), lzma.compress(points_text(points), preset=FASTEST), sync=False)


def read_symmetries(path: Path) -> Planes:
    """The planes of a `-sym.txt` file, whose first line counts planes and axes together; axes are checked and left out.

    Raises:
        OfficialFileError: naming file and line, for a wrong count, a wrong line or a normal of length zero.
    """
    count, body = split_count(Path(path).read_bytes(), path)
    lines = body.decode("utf-8", "replace").rstrip().split("\n") if body.strip() else []
    rows, numbers = [np.zeros((0, 6))], []
    for number, line in enumerate(lines, 2):
        kind, *fields = line.split() or [""]
        if kind not in ("plane", "axis"):
            raise complaint(path, number, f"the line begins with {kind[:LONGEST_QUOTE]!r}; it should be plane or axis")
        if kind == "axis":
            _check_angle(fields.pop() if fields else "", path, number)
        if len(fields) != 6:
            raise complaint(path, number, f"{kind} with {len(fields)} numbers, expected 6: {PLANE_COLUMNS}")
        row = parse_rows(" ".join(fields).encode(), PLANE_COLUMNS, path, number)
        if kind == "plane":
            rows.append(row)
            numbers.append(number)
    check_count(count, len(lines), path)
    return planes_of(np.concatenate(rows), path, np.array(numbers))


def _check_angle(angle: str, path: Path, line: int) -> None:
    try:
        if float(angle) > 0:
            return
    except ValueError:
        pass
    raise complaint(
        path, line, f"the axis ends with {angle[:LONGEST_QUOTE]!r}; it should be an angle in radians, or inf"
    )


def write_symmetries(path: Path, planes: Planes) -> None:
    """Write true planes under their count, `plane` before each."""
    write_atomically(Path(path), counted_text([f"plane {line}" for line in plane_lines(planes)]), sync=False)
