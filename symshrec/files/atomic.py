"""Files that are whole or absent: atomic writes, one writer per folder, a clear word when the disk is full."""

import errno
import fcntl
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
TEMPORARY = ".{name}.{process}.partial"


class FolderInUseError(ValueError):
    """Another process writes in this folder; says which."""


class DiskFullError(OSError):
    """No room for a file; says where and how much is needed."""


def write_atomically(path: Path, data: bytes, sync: bool = True) -> None:
    """Write `data` so that a kill at any moment leaves the old file, or none, or the whole new one.

    Args:
        sync: wait for the disk, so that this holds for a power cut too; slow for many small files.

    Raises:
        DiskFullError: where the disk, a quota or a file-size limit stops it; nothing is left behind.
    """
    temporary = path.with_name(TEMPORARY.format(name=path.name, process=os.getpid()))
    try:
        with open(temporary, "wb") as file:
            file.write(data)
            if sync:
                file.flush()
                os.fsync(file.fileno())
        os.replace(temporary, path)
    except OSError as error:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)
        if error.errno in FULL:
            raise DiskFullError(
                f"no room for {path} ({len(data) / 1e6:.1f} MB): {error.strerror}. Free some space and run the same "
                "command again; finished files are kept"
            ) from error
        raise


def remove_temporaries(root: Path) -> None:
    """Remove what killed writers left half-written."""
    for path in root.glob(TEMPORARY.format(name="*", process="*")):
        path.unlink(missing_ok=True)


def require_room(root: Path, needed: int) -> None:
    """Refuse to begin writing `needed` bytes where they do not fit.

    Raises:
        DiskFullError: naming the folder, the bytes needed and the bytes free.
    """
    free = shutil.disk_usage(root).free
    if needed > free:
        raise DiskFullError(
            f"{root}: about {needed / 1e6:.1f} MB to write, {free / 1e6:.1f} MB free. Free some space, choose another "
            "folder or a smaller scale"
        )


@contextmanager
def sole_writer(root: Path) -> Iterator[None]:
    """Hold `root` (created where missing) against other writers; a kill releases it.

    Raises:
        FolderInUseError: where another process is writing there.
    """
    root.mkdir(parents=True, exist_ok=True)
    folder = os.open(root, os.O_RDONLY)
    try:
        with suppress(OSError):
            try:
                fcntl.flock(folder, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise FolderInUseError(
                    f"{root}: another process is writing here; wait for it, or give another folder"
                ) from None
        yield
    finally:
        os.close(folder)
