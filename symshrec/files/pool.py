"""§3.3.1 Many clouds at once: a pool of single-threaded processes, kept from batch to batch."""

import multiprocessing
import os
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import BrokenExecutor, ProcessPoolExecutor
from itertools import zip_longest

import numpy as np
from threadpoolctl import threadpool_limits

from symshrec.files.processes import end_with_parent, main_left_out
from symshrec.planes import Planes

Find = Callable[[np.ndarray, object], Planes]  # (points (N, 3), settings); a function of a module, to be sent by name


def detect_named(detect: Find, name: str, points: np.ndarray, settings) -> Planes:
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


class DetectionPool:
    """`detect_named` over clouds, on processes that start with the first call and end with `close` or an error.

    Args:
        workers: processes; 0 and 1 work in this one. The planes do not depend on their number.

    Raises:
        ValueError: for a negative number.
    """

    def __init__(self, workers: int):
        if workers < 0:
            raise ValueError(f"workers is {workers}, expected 0 or more")
        self.workers = workers
        self._executor: ProcessPoolExecutor | None = None

    def map(self, find: Find, names: Sequence[str], clouds: Sequence, others: Sequence) -> list[Planes]:
        """find(cloud, other) for every named cloud (N, 3) and its other argument, in order.

        On several processes `find` is a function of a module, and clouds are arrays.

        Raises:
            ValueError, RuntimeError: as `detect_named`; RuntimeError too where a process died, naming the clouds lost.
        """
        jobs = list(zip(names, clouds, others, strict=True))
        if self.workers <= 1:
            return [detect_named(find, *job) for job in jobs]
        futures = []
        try:
            with main_left_out():
                for job in jobs:
                    futures.append(self._running().submit(detect_named, find, *job))
            return [future.result() for future in futures]
        except BrokenExecutor as error:
            finished = [future.done() and not future.exception() for future in futures]
            lost = ", ".join(name for name, done in zip_longest(names, finished) if not done)
            self.close()
            raise RuntimeError(f"a worker process died, perhaps for want of memory; without planes: {lost}") from error
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """End the processes; the next call would start new ones."""
        if self._executor is not None:
            self._executor.shutdown(cancel_futures=True)
            self._executor = None

    def _running(self) -> ProcessPoolExecutor:
        if self._executor is None:
            context = multiprocessing.get_context("spawn")  # a fork would copy the locks that torch's threads may hold
            self._executor = ProcessPoolExecutor(self.workers, mp_context=context, initializer=_start)
        return self._executor


def _start() -> None:
    end_with_parent()
    os.environ["OMP_NUM_THREADS"] = "1"  # of what is still to be imported; the rest is told
    threadpool_limits(1)
    if "torch" in sys.modules:
        sys.modules["torch"].set_num_threads(1)
