"""Where a command writes: names with the file's own name in them, in folders that are made."""

from pathlib import Path

from symshrec.scans import stem_of

STEM = "{stem}"


def out_path(option: str, out: str, path: Path) -> Path:
    """What an option's OUT names for one file; its folder is made.

    Raises:
        ValueError: where the folder cannot be made, naming the option.
    """
    named = Path(out.replace(STEM, stem_of(path)))
    make_folder(named, f"--{option} {out}")
    return named


def make_folder(path: Path, said: str) -> None:
    """Make the folder of a file, which the user named as `said`.

    Raises:
        ValueError: where it cannot be made.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ValueError(f"{said}: no folder {path.parent} can be made ({error.strerror})") from error
