"""Checkpoints of a training that no kill, full disk or flipped bit takes away: written, read back, only then trusted.

A training's folder holds `last.ckpt` and the one before it, `previous.ckpt`. A new checkpoint is written beside them as
`next.ckpt`, whole or not at all, and read back; then the last becomes the previous one and the next the last. A kill
between any two of these steps leaves at least one sound checkpoint under one of the three names, and the newest sound
one is where the training goes on.
"""

import hashlib
import io
import logging
import os
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import torch
from lightning.pytorch.plugins.io import CheckpointIO

from symshrec.files.atomic import write_atomically

log = logging.getLogger(__name__)
LAST, PREVIOUS, NEXT = "last.ckpt", "previous.ckpt", "next.ckpt"
NEWEST_FIRST = (NEXT, LAST, PREVIOUS)
# The sha256 stands in the comment that every zip archive may end with, so that file and checksum are one and can't get
# out of step, while `torch.load`, like all that reads zip archives, still reads the file.
MARK = b"symshrec sha256 "
DIGITS = 64
END, END_BYTES = b"PK\x05\x06", 22  # of a zip archive, with a comment of no bytes


class CheckpointError(ValueError):
    """No checkpoint of a training can be read; says which were tried and what to do."""


def sealed(archive: bytes) -> bytes:
    """What `torch.save` wrote, with the sha256 of all that comes before it as its last 64 bytes."""
    if archive[-END_BYTES:].find(END) != 0 or archive[-2:] != bytes(2):
        raise ValueError("torch.save wrote no zip archive without comment; a checksum cannot be added to it")
    content = archive[:-2] + (len(MARK) + DIGITS).to_bytes(2, "little") + MARK
    return content + hashlib.sha256(content).hexdigest().encode()


def damage(data: bytes) -> str | None:
    """What is wrong with a checkpoint file's bytes; None where they are what was written.

    A checkpoint without checksum, as Lightning writes them, is held against the CRC-32 of its parts.
    """
    content, digest = data[:-DIGITS], data[-DIGITS:]
    if content.endswith(MARK):
        return None if hashlib.sha256(content).hexdigest().encode() == digest else "its bytes do not match its sha256"
    if data[-END_BYTES:].find(END) != 0 or data[-2:] != bytes(2):
        return "it is cut short or altered at its end"
    try:
        part = zipfile.ZipFile(io.BytesIO(data)).testzip()
    except Exception as error:  # what a damaged archive raises is as various as its damages
        return f"it is no whole archive: {error}"
    return part and f"{part} does not match its CRC-32"


class VerifiedCheckpoints(CheckpointIO):
    """How Lightning's Trainer writes and reads checkpoint files: atomically in their own folder whatever TMPDIR is,
    with a sha256, and, of `last.ckpt`, with the one before it kept. Nothing but tensors and plain values is unpickled.
    """

    def save_checkpoint(self, checkpoint: dict[str, Any], path: str | Path, storage_options: Any = None) -> None:
        """Write and read back; only then does an earlier file of that name give way.

        Raises:
            DiskFullError: where there is no room. OSError: where the disk gives back something else. Either way the
            earlier checkpoints are as they were.
        """
        buffer = io.BytesIO()
        torch.save(checkpoint, buffer)
        path = Path(path)
        path.parent.mkdir(parents=True, exist_ok=True)
        new = path.with_name(NEXT if path.name == LAST else f"next-{path.name}")
        write_atomically(new, sealed(buffer.getvalue()))
        if wrong := damage(new.read_bytes()):
            new.unlink()
            raise OSError(f"{path}: what was just written is damaged ({wrong}); the disk or its driver is at fault")
        _promote(new, path)

    def load_checkpoint(self, path: str | Path, map_location: Any = "cpu", weights_only: bool | None = True) -> dict:
        """The checkpoint at `path`; where that is a training's last one, the newest sound one beside it.

        Raises:
            CheckpointError: where none is sound.
        """
        path = Path(path)
        return _newest(path.parent, NEWEST_FIRST if path.name == LAST else (path.name,), map_location)[1]

    def remove_checkpoint(self, path: str | Path) -> None:
        """Remove a file that Lightning keeps no longer."""
        Path(path).unlink(missing_ok=True)


def begun(folder: Path) -> bool:
    """Whether a training's folder holds a checkpoint, sound or not."""
    return any((folder / name).exists() for name in NEWEST_FIRST)


def settle(folder: Path) -> None:
    """End what a kill interrupted while checkpoints were renamed."""
    if (new := folder / NEXT).exists() and damage(new.read_bytes()) is None:
        _promote(new, folder / LAST)


def steps_done(folder: Path) -> int:
    """Optimiser steps that the newest sound checkpoint of a training's folder has behind it.

    Raises:
        CheckpointError: where there is none.
    """
    return _newest(folder, NEWEST_FIRST)[1]["global_step"]


def copy_newest(source: Path, target: Path) -> None:
    """Begin a training in `target` with the newest sound checkpoint in `source`.

    Raises:
        CheckpointError: where there is none.
    """
    write_atomically(target / LAST, _newest(source, NEWEST_FIRST)[0])


def forget_previous(folder: Path) -> None:
    """Leave the last checkpoint alone in the folder of a finished training."""
    if damage((folder / LAST).read_bytes()) is None:
        (folder / PREVIOUS).unlink(missing_ok=True)


def _promote(new: Path, path: Path) -> None:
    """Put a verified file in its place; a last.ckpt that stood there and is sound becomes the previous one."""
    if path.name == LAST and path.exists() and damage(path.read_bytes()) is None:
        os.replace(path, path.with_name(PREVIOUS))
    os.replace(new, path)


def _newest(folder: Path, names: tuple[str, ...], map_location: Any = "cpu") -> tuple[bytes, dict]:
    """Bytes and content of the first sound file; every damaged one before it is named in a warning."""
    tried = []
    for name, data in _files(folder, names):
        if (wrong := damage(data)) is None:
            try:
                checkpoint = torch.load(io.BytesIO(data), map_location=map_location, weights_only=True)
            except Exception as error:  # as above; without a checksum, damage may come to light only here
                wrong = f"PyTorch {torch.__version__} can't read it: {str(error).splitlines()[0]}"
            else:
                for each in tried:
                    log.warning("%s; going on from %s, step %s", each, name, checkpoint.get("global_step"))
                return data, checkpoint
        tried.append(f"{folder / name} is damaged: {wrong}")
    wanted = LAST if LAST in names else names[0]
    raise CheckpointError(
        f"{'; '.join(tried) or f'{folder} holds no checkpoint'}. Put back a copy of {wanted}, or remove {folder} to "
        "train anew"
    )


def _files(folder: Path, names: tuple[str, ...]) -> Iterator[tuple[str, bytes]]:
    for name in names:
        try:
            yield name, (folder / name).read_bytes()
        except FileNotFoundError:
            continue
