"""Work over many clouds on all cores, in order, with a progress bar."""

import os
from collections.abc import Callable, Iterator, Sequence
from typing import TypeVar

from tqdm import tqdm

from symshrec.files.pool import ProcessPool

Result = TypeVar("Result")
CHUNK = 32  # clouds handed to a process at once
ALONE = 256  # so few clouds are done before another process has started


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

    Raises:
        WorkerDiedError: where a process died.
    """
    chunks = [(positions[start : start + CHUNK],) for start in range(0, len(positions), CHUNK)]
    progress = tqdm(total=len(positions), desc=description, unit=" clouds", disable=None)
    with progress, ProcessPool(1 if len(positions) <= ALONE else workers, work) as pool:
        for results in pool.results(_over_chunk, chunks):
            yield from results
            progress.update(len(results))


def _over_chunk(work: Callable[[int], Result], chunk: Sequence[int]) -> list[Result]:
    return [work(position) for position in chunk]
