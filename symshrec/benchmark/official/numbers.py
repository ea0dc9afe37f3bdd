"""The track's files: rows of numbers in text, read fast where well formed, and line by line where not."""

import re
from pathlib import Path

import numpy as np

NEWLINE, BLANK, MINUS, POINT, ZERO = (ord(character) for character in "\n -.0")
NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
LONGEST_QUOTE = 40  # characters of a file that an error repeats
LARGEST_ID = 2**63 - 1
LONGEST_MANTISSA = 15  # decimal digits that a float64 carries exactly


class OfficialFileError(ValueError):
    """A file or folder of the track that cannot be taken as it stands: where, what is wrong, and what to do."""


def complaint(path: Path, line: int, problem: str) -> OfficialFileError:
    """The error for a line, counted from 1, of a file."""
    return OfficialFileError(f"{path}:{line}: {problem}")


def cloud_id(digits: str, path: Path) -> int:
    """A cloud's ID from the digits in a file's name.

    Raises:
        OfficialFileError: for an ID that is larger than int64 holds.
    """
    if (cloud := int(digits)) > LARGEST_ID:
        raise OfficialFileError(f"{path}: the ID {digits[:LONGEST_QUOTE]} is too large; IDs are at most {LARGEST_ID}")
    return cloud


def parse_rows(text: bytes, columns: str, path: Path, first_line: int = 1) -> np.ndarray:
    """Finite numbers from lines of equal width, separated by spaces or tabs.

    Args:
        text: the lines; Windows line ends and blank lines at the end are accepted.
        columns: what each line holds, such as "x y z".
        path: where the text is from, for errors.
        first_line: the line of the file at which the text starts.

    Returns:
        (rows, columns) float64.

    Raises:
        OfficialFileError: naming file and line, for a wrong number of columns, a blank line before the end, or anything
            that is not a finite number.
    """
    rows = _parse_at_once(text, len(columns.split()))
    return _parse_by_line(text, columns, path, first_line) if rows is None else rows


def parse_counted_rows(text: bytes, columns: str, path: Path) -> np.ndarray:
    """As `parse_rows`, for a file whose first line says how many rows follow.

    Raises:
        OfficialFileError: also for a count that is not a whole number, and for more or fewer rows than it says.
    """
    count, body = split_count(text, path)
    rows = parse_rows(body, columns, path, first_line=2)
    check_count(count, len(rows), path)
    return rows


def split_count(text: bytes, path: Path) -> tuple[int, bytes]:
    """The count on the first line, and the text after that line.

    Raises:
        OfficialFileError: for an empty file, and for a first line that is not a whole number of at least 0.
    """
    head, _, body = text.partition(b"\n")
    head = head.strip()
    if not text.strip():
        raise complaint(
            path, 1, "the file is empty; its first line should be the number of planes, 0 where there is none"
        )
    if not re.fullmatch(rb"\d{1,9}", head):
        found = head[:LONGEST_QUOTE].decode("utf-8", "replace")
        raise complaint(path, 1, f"the first line is {found!r}; it should be the number of lines that follow")
    return int(head), body


def check_count(count: int, rows: int, path: Path) -> None:
    """Hold the number of rows found against the first line of their file.

    Raises:
        OfficialFileError: naming the first line that is missing or too many.
    """
    if rows < count:
        problem = (
            f"the file ends after {rows} of the {count} planes of its first line; restore the lines or mend the count"
        )
        raise complaint(path, rows + 2, problem)
    if rows > count:
        problem = f"one line more than the {count} of the first line; remove it or mend the count"
        raise complaint(path, count + 2, problem)


def _parse_at_once(text: bytes, width: int) -> np.ndarray | None:
    """The (rows, width) numbers of a well-formed text, None where it needs a closer look."""
    characters = np.frombuffer(text, np.uint8)
    inside = np.zeros(len(text) + 2, bool)
    np.greater(characters, BLANK, out=inside[1:-1])
    edges = np.flatnonzero(inside[1:] != inside[:-1])
    starts, ends = edges[::2], edges[1::2]
    rows, left_over = divmod(len(starts), width)
    if left_over or b"\0" in text:
        return None
    if not rows:
        return np.zeros((0, width))
    newlines = np.flatnonzero(characters == NEWLINE)
    between, trailing = newlines[: rows - 1], newlines[rows - 1 :]
    if len(between) < rows - 1 or (trailing < ends[-1]).any():
        return None
    if (between < ends[width - 1 : -1 : width]).any() or (between > starts[width::width]).any():
        return None
    numbers = _parse_decimals(characters, starts, ends)
    if numbers is None:
        numbers = _parse_numbers(text)
    if numbers is None or len(numbers) != len(starts) or not np.isfinite(numbers).all():
        return None
    return numbers.reshape(rows, width)


def _parse_decimals(characters: np.ndarray, starts: np.ndarray, ends: np.ndarray) -> np.ndarray | None:
    """The numbers at characters[starts[i]:ends[i]] where all have as many decimals as the first; None otherwise.

    Digit by digit over all numbers at once, five times the speed of a general parser and equal to it to the last bit: a
    mantissa and a power of ten that are both exact in float64 have a correctly rounded quotient.
    """
    first = characters[starts[0] : ends[0]]
    decimals = len(first) - 1 - int(np.argmax(first == POINT))
    points = ends - decimals - 1
    negative = characters[starts] == MINUS
    whole = points - starts - negative
    if (points < starts).any() or (characters[points] != POINT).any() or whole.min() < 1:
        return None
    if decimals + whole.max() > LONGEST_MANTISSA:
        return None
    digits = characters - np.uint8(ZERO)
    mantissas = np.zeros(len(starts), np.int64)
    for power in range(decimals + int(whole.max())):
        if power < decimals:
            digit = digits[ends - 1 - power]
        else:
            digit = np.where(whole > power - decimals, digits[points - 1 - (power - decimals)], 0)
        if digit.max() > 9:
            return None
        mantissas += np.multiply(digit, 10**power, dtype=np.int64)
    numbers = mantissas / 10.0**decimals
    return np.where(negative, -numbers, numbers)


def _parse_numbers(text: bytes) -> np.ndarray | None:
    """All numbers of a text in any notation, None where a part of it is no number."""
    try:
        return None if b"_" in text else np.array(text.split(), dtype=np.float64)
    except ValueError:
        return None


def _parse_by_line(text: bytes, columns: str, path: Path, first_line: int) -> np.ndarray:
    """The definition of what is well formed; `_parse_at_once` accepts no more than this."""
    names = columns.split()
    lines = text.decode("utf-8", "replace").rstrip().split("\n")
    rows = []
    for number, line in enumerate(lines if text.strip() else [], first_line):
        fields = line.split()
        if not fields:
            raise complaint(path, number, "a blank line between the others; remove it")
        if len(fields) != len(names):
            raise complaint(path, number, f"{len(fields)} columns, expected {len(names)}: {columns}")
        for name, field in zip(names, fields, strict=True):
            if not NUMBER.fullmatch(field) or not np.isfinite(float(field)):
                raise complaint(path, number, f"{name} is {field[:LONGEST_QUOTE]!r}; it should be a finite number")
        rows.append([float(field) for field in fields])
    return np.array(rows, dtype=np.float64).reshape(-1, len(names))
