"""Files that are whole or absent: atomic writes, one writer per folder, a clear word when the disk is full."""

import errno
import fcntl
import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
TEMPORARY = ".{name}.{process}.partial"
_HELD: set[int] = set()  # descriptors of the folders that this process holds


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
    with atomic_writer(path, len(data), sync) as file:
        file.write(data)


@contextmanager
def atomic_writer(path: Path, size: int, sync: bool = True) -> Iterator[BinaryIO]:
    """A file to write, which takes the place of `path` when it is whole, as `write_atomically` says.

    Args:
        size: bytes to come, for the error's words. sync: wait for the disk.

    Raises:
        DiskFullError: as `write_atomically`.
    """
    process = f"{os.getpid()}-{secrets.token_hex(4)}"  # other machines have processes of this number too
    temporary = path.with_name(TEMPORARY.format(name=path.name, process=process))
    try:
        with open(temporary, "wb") as file:
            yield file
            if sync:
                file.flush()
                os.fsync(file.fileno())
        os.replace(temporary, path)
    except BaseException as error:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)
        if isinstance(error, OSError) and error.errno in FULL:
            raise DiskFullError(
                f"no room for {path} ({size / 1e6:.1f} MB): {error.strerror}. Free some space and run the same "
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
    """Hold `root` (created where missing) against other writers, of this process too; a kill releases it.

    Raises:
        FolderInUseError: where somebody else holds it, naming the folder and, on Linux, the process.
    """
    with _held(root, fcntl.LOCK_EX):
        yield


@contextmanager
def joint_writer(root: Path) -> Iterator[None]:
    """Hold `root` together with other joint writers, each of which has files of its own, against a sole one.

    Raises:
        FolderInUseError: as `sole_writer`.
    """
    with _held(root, fcntl.LOCK_SH):
        yield


@contextmanager
def _held(root: Path, kind: int) -> Iterator[None]:
    root.mkdir(parents=True, exist_ok=True)
    folder = os.open(root, os.O_RDONLY)
    _HELD.add(folder)
    try:
        with suppress(OSError):  # a file system without locks
            try:
                fcntl.flock(folder, kind | fcntl.LOCK_NB)
            except BlockingIOError:
                raise FolderInUseError(
                    f"{root}: another process is writing here{_holder(folder)}; wait for it, or give another folder"
                ) from None
        yield
    finally:
        _HELD.discard(folder)
        os.close(folder)


def _holder(folder: int) -> str:
    """The process that holds the lock of an open folder, " (pid 7)"; empty where the system doesn't say."""
    place = os.fstat(folder)
    name = f"{os.major(place.st_dev):02x}:{os.minor(place.st_dev):02x}:{place.st_ino}"
    with suppress(OSError):
        for line in Path("/proc/locks").read_text(encoding="ascii").splitlines():
            fields = line.split()  # 1: FLOCK ADVISORY WRITE 4711 08:01:131072 0 EOF
            if fields[1] == "FLOCK" and fields[5] == name and int(fields[4]) > 0:
                return f" (pid {fields[4]})"
    return ""


def _release_in_child() -> None:
    """A forked worker that outlives a killed writer must not go on holding its folder."""
    for folder in _HELD:
        with suppress(OSError):
            os.close(folder)
    _HELD.clear()


os.register_at_fork(after_in_child=_release_in_child)
