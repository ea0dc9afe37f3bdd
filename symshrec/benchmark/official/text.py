"""§2.2–2.3 The track's text files: points, true planes, and a method's planes."""

import re
import warnings
from pathlib import Path

import numpy as np

from symshrec.benchmark.official.numbers import LONGEST_QUOTE, complaint, parse_counted_rows, parse_rows
from symshrec.files.atomic import write_atomically
from symshrec.planes import Planes
from symshrec.planes.planes import MIN_NORMAL_LENGTH

POINT_DECIMALS = 6  # as the track prints them
PLANE_DECIMALS = 12  # ours: the track's own number is not known, and a reader takes any
POINT_COLUMNS = "x y z"
PLANE_COLUMNS = "nx ny nz px py pz"
RESULT_COLUMNS = f"{PLANE_COLUMNS} confidence"

RESULTS_FILE = "points{id}_res.txt"


class ConfidenceWarning(UserWarning):
    """A file of results has confidences outside [0, 1]: scoring needs only their order, a threshold needs more."""


def read_points(path: Path) -> np.ndarray:
    """The cloud of a `points<ID>.txt`: (N, 3) float64, as it stands there and as the organisers' script reads it.

    Raises:
        OfficialFileError: naming file and line, for a file without points and for all but three finite numbers a line.
    """
    return parse_points(Path(path).read_bytes(), path)


def parse_points(text: bytes, path: Path) -> np.ndarray:
    """As `read_points`, for text that is already at hand; `path` is for errors."""
    rows = parse_rows(text, POINT_COLUMNS, path)
    if not len(rows):
        raise complaint(path, 1, "the file is empty; it should hold one point a line: x y z")
    too_large = np.abs(rows) > np.finfo(np.float32).max  # methods get single precision
    if too_large.any():
        line = int(np.argwhere(too_large)[0, 0]) + 1
        raise complaint(path, line, "a coordinate too large for single precision; scale the cloud down")
    return rows


def read_planes(path: Path) -> Planes:
    """The true planes of a `points<ID>_sym.txt`, in its order, normals scaled to length one.

    Raises:
        OfficialFileError: naming file and line, for a wrong count, a wrong line or a normal of length zero.
    """
    rows = parse_counted_rows(Path(path).read_bytes(), PLANE_COLUMNS, path)
    return planes_of(rows, path, np.arange(len(rows)) + 2)


def read_results(path: Path) -> Planes:
    """A method's planes with their confidences from a `points<ID>_res.txt`, in its order.

    Warns:
        ConfidenceWarning: naming the file and how many, where confidences are outside [0, 1].

    Raises:
        OfficialFileError: as `read_planes`; also for a confidence that is not finite: it would have no rank.
    """
    rows = parse_counted_rows(Path(path).read_bytes(), RESULT_COLUMNS, path)
    planes = planes_of(rows, path, np.arange(len(rows)) + 2)
    warn_of_confidences(planes.confidences, path)
    return planes


def warn_of_confidences(confidences: np.ndarray, path: Path) -> None:
    """Warn, once for a file, of confidences (K,) that are outside [0, 1]; they rank as all others do."""
    if count := confidences_outside(confidences):
        text = f"{path}: {count} of {len(confidences)} confidences are outside [0, 1]; they are ranked as they are"
        warnings.warn(text, ConfidenceWarning, stacklevel=3)


def confidences_outside(confidences: np.ndarray) -> int:
    """How many confidences are outside [0, 1], where the track has them."""
    return int(((confidences < 0) | (confidences > 1)).sum())


def planes_of(rows: np.ndarray, path: Path, lines: np.ndarray) -> Planes:
    """Planes from (K, 6) or, with confidences, (K, 7) numbers that stand on the given lines of a file."""
    lengths = np.linalg.norm(rows[:, :3], axis=1)
    for row in np.flatnonzero((lengths < MIN_NORMAL_LENGTH) | ~np.isfinite(lengths))[:1]:
        raise complaint(path, int(lines[row]), f"the normal has length {lengths[row]:g}; a plane needs a direction")
    return Planes(rows[:, :3], rows[:, 3:6], rows[:, 6] if rows.shape[1] > 6 else np.ones(len(rows)))


def write_points(path: Path, points: np.ndarray) -> None:
    """Write (N, 3) points as the track does, whole or not at all."""
    write_atomically(Path(path), points_text(points), sync=False)


def points_text(points: np.ndarray) -> bytes:
    """One `x y z` a line with six decimals."""
    line = " ".join(3 * [f"%.{POINT_DECIMALS}f"]) + "\n"
    return (line * len(points) % tuple(points.ravel().tolist())).encode()


def write_planes(path: Path, planes: Planes) -> None:
    """Write true planes as the track does; what is read back is written as the same text again."""
    write_atomically(Path(path), counted_text(plane_lines(planes)), sync=False)


def write_results(path: Path, planes: Planes) -> None:
    """Write planes with confidences as the track's participants did; confidences keep every bit."""
    lines = zip(plane_lines(planes), planes.confidences.tolist(), strict=True)
    write_atomically(Path(path), counted_text([f"{line} {confidence!r}" for line, confidence in lines]), sync=False)


def plane_lines(planes: Planes) -> list[str]:
    """`nx ny nz px py pz` for every plane."""
    line = " ".join(6 * [f"%.{PLANE_DECIMALS}f"])
    return [line % tuple(row) for row in np.hstack([printed_normals(planes), planes.points]).tolist()]


def printed_normals(planes: Planes) -> np.ndarray:
    """(K, 3) normals in decimals that stay the same when they are read, scaled to length one and printed again.

    Rounding leaves a length a little off one, and mending that can carry the largest component to the next decimal;
    that decimal brings the length closer to one, and the next turn changes nothing.
    """
    printed = np.round(planes.normals, PLANE_DECIMALS)
    for _ in range(3):
        printed = np.round(Planes(printed, planes.points).normals, PLANE_DECIMALS)
    return printed


def counted_text(lines: list[str]) -> bytes:
    """Lines under their number."""
    return "".join(f"{line}\n" for line in [str(len(lines)), *lines]).encode()


def read_subset(path: Path) -> list[int]:
    """The IDs of a subset list, one a line, in its order.

    Raises:
        OfficialFileError: naming file and line, for anything but a whole number and for an ID that is listed twice.
    """
    lines = Path(path).read_text(encoding="utf-8-sig", errors="replace").rstrip().split("\n")
    first_seen: dict[int, int] = {}
    for number, line in enumerate(lines, 1):
        if not re.fullmatch(r"[0-9]{1,18}", line.strip()):
            raise complaint(
                path, number, f"{line.strip()[:LONGEST_QUOTE]!r} is not a cloud's ID; write one whole number a line"
            )
        cloud = int(line)
        if cloud in first_seen:
            raise complaint(path, number, f"ID {cloud} is already on line {first_seen[cloud]}; list it once")
        first_seen[cloud] = number
    return list(first_seen)
