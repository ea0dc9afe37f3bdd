"""§3.3.1 Many clouds at once: a pool of single-threaded processes that need no torch, kept from batch to batch."""

import multiprocessing
from collections.abc import Sequence
from concurrent.futures import BrokenExecutor, ProcessPoolExecutor
from itertools import zip_longest

import numpy as np
from threadpoolctl import threadpool_limits

from symshrec.methods.m3.detection import M3Settings, detect_planes
from symshrec.planes import Planes
from symshrec.workers import end_with_parent, main_left_out


def detect_named(name: str, points: np.ndarray, settings: M3Settings) -> Planes:
    """`detect_planes`, with the cloud's name in front of whatever it raises.

    Raises:
        ValueError: where the points cannot be used. RuntimeError: where the detection fails.
    """
    try:
        return detect_planes(points, settings)
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

    def detect(self, names: Sequence[str], clouds: Sequence[np.ndarray], settings: M3Settings) -> list[Planes]:
        """The planes of every cloud (N, 3), in order.

        Raises:
            ValueError, RuntimeError: as `detect_named`; RuntimeError too where a process died, naming the clouds lost.
        """
        jobs = list(zip(names, clouds, strict=True))
        if self.workers <= 1:
            return [detect_named(name, cloud, settings) for name, cloud in jobs]
        futures = []
        try:
            with main_left_out():
                for name, cloud in jobs:
                    futures.append(self._running().submit(detect_named, name, cloud, settings))
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
    threadpool_limits(1)
