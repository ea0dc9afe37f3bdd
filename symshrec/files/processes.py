"""Worker processes that start light and never outlive the command that started them."""

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing.connection import wait
from types import ModuleType


def end_with_parent() -> None:
    """End this worker the moment its parent is gone, so that no orphan writes into a folder taken up again.

    Ctrl-C is left to the parent, which lets the work in hand be finished.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)

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
