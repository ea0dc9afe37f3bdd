"""Worker processes that start light and never outlive the command that started them."""

import multiprocessing
import multiprocessing.context
import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing.connection import wait
from types import ModuleType

_forks: list[int] = []  # of this process's ancestry since the import
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=lambda: _forks.append(os.getpid()))


def forked() -> bool:
    """Whether this process is a fork of one that may have computed: of its threads, which torch's operations would wait
    for in vain, it has none. On one thread they wait for nobody."""
    kind = getattr(multiprocessing.context, "ForkProcess", ())
    return bool(_forks) or isinstance(multiprocessing.current_process(), kind)


def end_with_parent() -> None:
    """End this worker the moment its parent is gone, so that no orphan writes into a folder taken up again.

    Ctrl-C is left to the parent, which lets the work in hand be finished, and so is SIGUSR2, by which SLURM announces
    the end of a job's time to all its processes.
    """
    for number in (signal.SIGINT, signal.SIGUSR2):
        signal.signal(number, signal.SIG_IGN)

    def watch():
        wait([multiprocessing.parent_process().sentinel])
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


@contextmanager
def main_left_out() -> Iterator[None]:
    """Processes spawned within do not import the main program again.

    What they run must be importable without it. They are then spared what the program imports for itself, which for a
    command with PyTorch in it is 400 MB and seconds for each process.
    """
    main = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = main
