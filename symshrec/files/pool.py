"""Many clouds at once: the one pool of single-threaded processes, for generating, reading and detecting."""

import multiprocessing
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Future, ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from typing import Any

from threadpoolctl import threadpool_limits

from symshrec.files.processes import end_with_parent, main_left_out
from symshrec.files.threads import one_thread
from symshrec.planes import Planes

Find = Callable[[Any, Any], Planes]  # (points (N, 3), settings); a function of a module, to be sent by name

_shared: tuple = ()  # in a worker process, what it was given at its start
_kept: dict[int, ProcessPoolExecutor] | None = None  # within `kept_processes`, by number of workers


@contextmanager
def kept_processes() -> Iterator[None]:
    """Within, pools without shared arguments use the same processes, one pool after the other, until the end.

    Each row of the tables would otherwise start its own, which takes seconds where they import PyTorch.
    """
    global _kept
    before, _kept = _kept, {}
    try:
        yield
    finally:
        for executor in _kept.values():
            executor.shutdown(cancel_futures=True)
        _kept = before


class WorkerDiedError(RuntimeError):
    """A process of the pool was killed; `lost`: the places of the jobs without a result, ascending."""

    def __init__(self, lost: list[int]):
        super().__init__("a worker process died, perhaps for want of memory")
        self.lost = lost


class ProcessPool:
    """Processes of one thread each, which start light, with the first job, and never outlive this one.

    They are kept from call to call, and end with `close`, with an error or where the results are not wanted any more.

    Args:
        workers: processes; 0 and 1 work in this one, on one thread as well.
        shared: first arguments of all work, sent to each process once; picklable.

    Raises:
        ValueError: for a negative number.
    """

    def __init__(self, workers: int, *shared):
        if workers < 0:
            raise ValueError(f"workers is {workers}, expected 0 or more")
        self.workers, self.shared = workers, shared
        self._executor: ProcessPoolExecutor | None = None

    def results(self, work: Callable, jobs: Sequence[tuple], in_order: bool = True) -> Iterator:
        """work(*shared, *job) for every job, each as soon as it is there.

        Args:
            work: on several processes a function of a module other than the main program.
            in_order: of the jobs; else whichever is finished next.

        Raises:
            WorkerDiedError: where a process died. What `work` raises first goes through.
        """
        if self.workers <= 1:
            for job in jobs:
                with one_thread():
                    result = work(*self.shared, *job)
                yield result
            return
        futures: list[Future] = []
        try:
            with main_left_out():
                for job in jobs:
                    futures.append(self._running().submit(_do, work, *job))
            for future in futures if in_order else as_completed(futures):
                yield future.result()
        except BrokenExecutor as error:
            finished = {place for place, each in enumerate(futures) if each.done() and not each.exception()}
            self._end()
            raise WorkerDiedError([place for place in range(len(jobs)) if place not in finished]) from error
        except BaseException:
            self._end()
            raise

    def close(self) -> None:
        """End the processes after their jobs, unless they are kept; the next call would start new ones."""
        if self._executor is not None and self._executor in (_kept or {}).values():
            self._executor = None
        self._end()

    def _end(self) -> None:
        if self._executor is not None:
            self._executor.shutdown(cancel_futures=True)
            if _kept and _kept.get(self.workers) is self._executor:
                del _kept[self.workers]
            self._executor = None

    def __enter__(self) -> "ProcessPool":
        return self

    def __exit__(self, *error) -> None:
        self.close()

    def _running(self) -> ProcessPoolExecutor:
        if self._executor is None and _kept is not None and not self.shared:
            self._executor = _kept.get(self.workers)
        if self._executor is None:
            context = multiprocessing.get_context("spawn")  # a fork would copy the locks that torch's threads may hold
            self._executor = ProcessPoolExecutor(self.workers, context, initializer=_start, initargs=self.shared)
            if _kept is not None and not self.shared:
                _kept[self.workers] = self._executor
        return self._executor


class DetectionPool(ProcessPool):
    """§3.3.1 `detect_named` over many clouds; the planes do not depend on the number of processes."""

    def map(self, find: Find, names: Sequence[str], clouds: Sequence, others: Sequence) -> list[Planes]:
        """find(cloud, other) for every named cloud (N, 3) and its other argument, in order.

        On several processes `find` is a function of a module, and clouds are arrays.

        Raises:
            ValueError, RuntimeError: as `detect_named`; RuntimeError too where a process died, naming the clouds lost.
        """
        jobs = [(find, *job) for job in zip(names, clouds, others, strict=True)]
        try:
            with one_thread():  # once, not at every cloud
                return list(self.results(detect_named, jobs))
        except WorkerDiedError as error:
            lost = ", ".join(names[place] for place in error.lost)
            raise RuntimeError(f"{error}; without planes: {lost}") from error


def detect_named(detect: Find, name: str, points, settings) -> Planes:
    """`detect(points, settings)`, with the cloud's name in front of whatever it raises.

    Raises:
        ValueError: where the points cannot be used. RuntimeError: where the detection fails.
    """
    try:
        return detect(points, settings)
    except ValueError as error:
        raise ValueError(f"cloud {name}: {error}") from error
    except Exception as error:
        raise RuntimeError(f"cloud {name}: {error}") from error


def _start(*shared) -> None:
    global _shared
    _shared = shared
    end_with_parent()
    os.environ["OMP_NUM_THREADS"] = "1"  # for what is still to be imported; what is imported already follows
    threadpool_limits(1)
    if "torch" in sys.modules:
        sys.modules["torch"].set_num_threads(1)


def _do(work: Callable, *job):
    return work(*_shared, *job)
