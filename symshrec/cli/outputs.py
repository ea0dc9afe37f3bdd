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
    try:
        named.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ValueError(f"--{option} {out}: no folder {named.parent} can be made ({error.strerror})") from error
    return named
