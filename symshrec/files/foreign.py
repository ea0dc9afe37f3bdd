"""What is taken from a file that anyone may have written: JSON, names that become paths, whole numbers."""

import json
from pathlib import PurePosixPath, PureWindowsPath

LONGEST_NAME = 255  # bytes, as file systems have it
LARGEST_WHOLE = 2**63 - 1  # what int64 holds


def parse_json(text: str | bytes):
    """The value of a JSON text.

    Raises:
        ValueError: for anything else, also for NaN and infinities, text that is not Unicode, and nesting without end.
    """
    try:
        return json.loads(text, parse_constant=_refuse_constant)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None


def is_plain_name(name) -> bool:
    """Whether a value is the name of a file or folder and no more: joined to a folder, the path stays in it."""
    if not isinstance(name, str) or name in ("", ".", "..") or not name.isprintable():
        return False
    one = all(kind(name).name == name for kind in (PurePosixPath, PureWindowsPath))
    return one and len(name.encode(errors="surrogatepass")) <= LONGEST_NAME


def is_whole(value, least: int = 0, most: int = LARGEST_WHOLE) -> bool:
    """Whether a value is a whole number, and no truth value, from `least` to `most`."""
    return isinstance(value, int) and not isinstance(value, bool) and least <= value <= most


def _refuse_constant(name: str):
    raise ValueError(f"it holds {name}, which is no number")
