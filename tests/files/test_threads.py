"""Whoever computes on one thread leaves every thread's number as it was."""

import itertools
import os
import subprocess
import sys
import threading

import pytest
import torch

from symshrec.files.pool import DetectionPool, ProcessPool, kept_processes
from symshrec.files.threads import one_thread
from symshrec.planes import Planes


@pytest.fixture
def three_threads():
    before = torch.get_num_threads()
    torch.set_num_threads(3)
    yield
    torch.set_num_threads(before)


def new_threads_number():
    found = []
    thread = threading.Thread(target=lambda: found.append(torch.get_num_threads()))
    thread.start()
    thread.join()
    return found[0]


def enter_and_leave(entering, leaving):
    """8 new threads that enter and leave in these orders: their numbers within and after, and errors."""
    turns = {place: (threading.Event(), threading.Event()) for place in entering}
    done, within, after = threading.Semaphore(0), {}, {}

    def work(place):
        enter, leave = turns[place]
        enter.wait(20)
        with one_thread():
            within[place] = torch.get_num_threads()
            done.release()
            leave.wait(20)
        after[place] = torch.get_num_threads()
        done.release()

    threads = [threading.Thread(target=work, args=(place,)) for place in entering]
    for thread in threads:
        thread.start()
    for step, order in enumerate((entering, leaving)):
        for place in order:
            turns[place][step].set()
            assert done.acquire(timeout=20)
    for thread in threads:
        thread.join(20)
    return [within[place] for place in entering], [after[place] for place in entering]


@pytest.mark.parametrize("leaving", [range(8), range(7, -1, -1), (3, 0, 7, 1, 6, 2, 5, 4)])
def test_eight_threads_in_any_order(three_threads, leaving):
    within, after = enter_and_leave(range(8), leaving)
    assert (within, after) == ([1] * 8, [3] * 8)
    assert (torch.get_num_threads(), new_threads_number()) == (3, 3)


def test_a_threads_own_number_stays_its_own(three_threads):
    with one_thread():
        torch.set_num_threads(1)
        torch.set_num_threads(2)  # its own wish, which ends with the block
        with one_thread():
            assert torch.get_num_threads() == 1
        assert torch.get_num_threads() == 2
    assert torch.get_num_threads() == 3


def test_an_error_and_a_thread_begun_within_change_nothing(three_threads):
    with pytest.raises(ZeroDivisionError), one_thread():
        1 / (new_threads_number() - 3)
    assert (torch.get_num_threads(), new_threads_number()) == (3, 3)


def test_many_at_once(three_threads):
    wrong = []

    def work():
        for _ in itertools.repeat(None, 50):
            with one_thread():
                wrong.extend([within] if (within := torch.get_num_threads()) != 1 else [])
            wrong.extend([after] if (after := torch.get_num_threads()) != 3 else [])

    threads = [threading.Thread(target=work) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert (wrong, torch.get_num_threads(), new_threads_number()) == ([], 3, 3)


@pytest.mark.parametrize("workers", [0, 1])
def test_the_pool_without_processes_computes_on_one_thread(three_threads, workers):
    seen = []
    DetectionPool(workers).map(lambda *_: seen.append(torch.get_num_threads()) or Planes.empty(), "ab", "ab", "ab")
    assert (seen, torch.get_num_threads()) == ([1, 1], 3)


def test_torch_is_not_imported_for_it():
    program = (
        "import sys\nfrom symshrec.files.threads import one_thread\nwith one_thread(): print('torch' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


def test_pools_share_their_processes_where_these_are_kept_and_only_there():
    def processes() -> set[int]:
        with ProcessPool(2) as pool:
            return set(pool.results(os.getpid, [()] * 8))

    with kept_processes():
        seen = set.union(*(processes() for _ in range(3)))
        assert 1 <= len(seen) <= 2
        with pytest.raises(ZeroDivisionError), ProcessPool(2) as pool:
            list(pool.results(divmod, [(1, 0)]))
        assert not seen & processes()  # those of a pool that failed are not trusted again
    assert not seen & processes()
    assert not any(os.path.exists(f"/proc/{process}") for process in seen)
