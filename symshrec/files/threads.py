"""Torch on one thread, for the thread that asks for it alone."""

import os
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypeVar

Result = TypeVar("Result")
_changing = threading.Lock()


@contextmanager
def one_thread() -> Iterator[None]:
    """Torch computes within on one thread; afterwards every thread has the number that it had before.

    The tensors of one cloud are too small for several to gain anything, and where other programs keep the cores busy
    they wait for each other: M4 then takes 0.2 s on one thread, and up to 10 on two. Any number of threads may be
    within at a time. Nothing happens where torch has not been imported.
    """
    torch = sys.modules.get("torch")
    if torch is None:
        yield
        return
    with _changing:
        before = torch.get_num_threads()
    _set_here(torch, 1)
    try:
        yield
    finally:
        _set_here(torch, before)


def _set_here(torch, threads: int) -> None:
    """`torch.set_num_threads` for this thread, and for no other.

    Torch keeps one number for each thread and one that a new thread starts with, and sets both at once. So the second
    is read in a new thread before, and set again in another after.
    """
    with _changing:
        if torch.get_num_threads() == threads:
            return
        of_new_threads = _in_new_thread(torch.get_num_threads)
        torch.set_num_threads(threads)
        _in_new_thread(torch.set_num_threads, of_new_threads)


def _in_new_thread(function: Callable[..., Result], *arguments) -> Result:
    results = []
    thread = threading.Thread(target=lambda: results.append(function(*arguments)))
    thread.start()
    thread.join()
    return results[0]


def _renew_lock() -> None:
    global _changing
    _changing = threading.Lock()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_renew_lock)  # the thread that held it is not in the child
