"""Sweeps that go through a queueing system: what Hydra's launchers need, and what of their errors is for users."""

import os
import shutil
import signal
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib.util import find_spec

CHOICE = "hydra/launcher="
PACKAGES = {  # of each launcher: the module that Hydra finds it by, and our extra that brings it
    "joblib": ("hydra_plugins.hydra_joblib_launcher", "launchers"),
    "submitit_slurm": ("hydra_plugins.hydra_submitit_launcher", "slurm"),
    "submitit_local": ("hydra_plugins.hydra_submitit_launcher", "slurm"),
}
HYDRAS_TRACEBACKS = "HYDRA_FULL_ERROR"  # "1": Hydra lets errors through instead of printing them itself
GOES_ON = "the same command goes on where this one was"


def refuse_missing(words: Sequence[str]) -> None:
    """Refuse a launcher that cannot work here.

    Args:
        words: of the command line.

    Raises:
        ValueError: naming what to install, or the program that SLURM's launcher needs.
    """
    launcher = _launcher(words)
    if launcher not in PACKAGES:
        return
    module, extra = PACKAGES[launcher]
    if not _importable(module):
        raise ValueError(f"{CHOICE}{launcher} is not installed; pip install 'symshrec[{extra}]'")
    if launcher == "submitit_slurm" and not (shutil.which("sbatch") and shutil.which("srun")):
        raise ValueError(
            f"{CHOICE}{launcher} submits jobs with SLURM's sbatch and srun, which are not on the PATH; call it on a "
            f"machine of the cluster, or choose {CHOICE}joblib for this one"
        )


@contextmanager
def errors_let_through(words: Sequence[str]) -> Iterator[None]:
    """Within, Hydra raises the errors of a sweep whose jobs submitit runs, which it would print with its traceback."""
    before = os.environ.get(HYDRAS_TRACEBACKS)
    if not (_launcher(words) or "").startswith("submitit"):
        yield
        return
    os.environ[HYDRAS_TRACEBACKS] = "1"
    try:
        yield
    finally:
        _restore(before)


def queued() -> bool:
    """Whether submitit runs this process: a job on SLURM or, with its local launcher, on this machine."""
    return "SUBMITIT_EXECUTOR" in os.environ


def prepare_job(tracebacks: str | None) -> None:
    """Make this process, in which a job begins, behave alike whatever launched it.

    SLURM sends the signal that announces the end of a job's time to all of its processes. It is for this one to be
    queued again; those that it forks would do so once more, and ignore it instead.

    Args:
        tracebacks: HYDRA_FULL_ERROR before `errors_let_through`.
    """
    _restore(tracebacks)
    if not queued():
        return
    number = getattr(signal, f"SIG{os.environ.get('SUBMITIT_PREEMPT_SIGNAL', 'USR2')}")
    os.register_at_fork(after_in_child=lambda: _ignore(number))


@contextmanager
def end_left_to_queue() -> Iterator[None]:
    """Within a job, SIGTERM does not end it: SLURM sends that a while before it takes the job's place away and queues
    it again. A process that ends before, as Lightning's Trainer has it do, counts as a job that is done."""
    try:
        yield
    except SystemExit as error:
        while queued() and not error.code:
            time.sleep(1)
        raise


def told_by_queue(error: BaseException | None) -> str | None:
    """What submitit's error says in one line, None for errors of others and for one with a traceback of the job."""
    while error is not None and not _is_submitits(error):
        error = error.__cause__ or error.__context__
    lines = [line.strip() for line in str(error or "").splitlines() if line.strip()]
    if not lines or "with trace:" in lines[0]:
        return None
    if "timed-out" in lines[0]:
        return (
            f"the time of this job was over, hydra.launcher.timeout_min; {GOES_ON}, and "
            "hydra.launcher.max_num_timeout=N has it queued again by itself, N times"
        )
    if "sbatch" in lines[0]:
        return f"SLURM refuses the jobs: {lines[-1].removeprefix('sbatch: error: ')} ({lines[0]})"
    return f"{' '.join(lines[:2])}; what it printed lies beside that, and {GOES_ON}"


def _is_submitits(error: BaseException) -> bool:
    names = {each.__name__ for each in type(error).__mro__ if each.__module__.startswith("submitit.")}
    return bool(names & {"UncompletedJobError", "FailedSubmissionError"})


def _launcher(words: Sequence[str]) -> str | None:
    chosen = [word.partition("=")[2].strip("'\"") for word in words if word.startswith(CHOICE)]
    return chosen[-1] if chosen else None


def _importable(module: str) -> bool:
    with suppress(ModuleNotFoundError):  # of hydra_plugins, where there are none at all
        return find_spec(module) is not None
    return False


def _restore(tracebacks: str | None) -> None:
    if tracebacks is None:
        os.environ.pop(HYDRAS_TRACEBACKS, None)
    else:
        os.environ[HYDRAS_TRACEBACKS] = tracebacks


def _ignore(number: int) -> None:
    with suppress(ValueError):  # forked by another thread than the main one
        signal.signal(number, signal.SIG_IGN)
