"""Work over many clouds on all cores, in order, with a progress bar."""

import multiprocessing
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import TypeVar

from tqdm import tqdm

from symshrec.files.processes import end_with_parent

Result = TypeVar("Result")
CHUNK = 32  # clouds handed to a process at once
ALONE = 256  # so few clouds are done before another process has started

_work: Callable | None = None


def available_cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def over_clouds(
    work: Callable[[int], Result], positions: Sequence[int], description: str, workers: int
) -> Iterator[Result]:
    """work(position) for every position, in order, on several processes; the first exception ends it.

    Args:
        work: picklable; handed to each process once.
        description: of the progress bar, which shows only where stderr is a terminal.
        workers: processes; few clouds are done in this one.
    """
    chunks = [positions[start : start + CHUNK] for start in range(0, len(positions), CHUNK)]
    with tqdm(total=len(positions), desc=description, unit=" clouds", disable=None) as progress:
        for results in _finished(work, chunks, 1 if len(positions) <= ALONE else workers):
            yield from results
            progress.update(len(results))


def _finished(work: Callable, chunks: list, workers: int) -> Iterator[list]:
    if workers == 1:
        for chunk in chunks:
            yield [work(position) for position in chunk]
        return
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, context, initializer=_take, initargs=(work,)) as processes:
        yield from processes.map(_do, chunks)


def _take(work: Callable) -> None:
    global _work
    _work = work
    end_with_parent()


def _do(chunk: Sequence[int]) -> list:
    return [_work(position) for position in chunk]
