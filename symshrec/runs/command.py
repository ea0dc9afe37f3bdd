"""Functions of a configuration as Hydra commands, whose users read one line where something is wrong."""

import functools
import multiprocessing
import os
import sys
import traceback
from argparse import Namespace
from collections.abc import Callable, Sequence
from pathlib import Path

import hydra
from hydra._internal.utils import get_args_parser
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.errors import HydraException
from omegaconf import DictConfig
from omegaconf.errors import OmegaConfBaseException

from symshrec.runs.config import MAIN, VERSION_BASE, conf_folder, hydra_apart, load, loader, register, resolvers
from symshrec.runs.queue import (
    end_left_to_queue,
    errors_let_through,
    prepare_job,
    queued,
    refuse_missing,
    told_by_queue,
)

USER_ERROR, INTERRUPTED = 2, 130
MISTAKES = (ValueError, OSError, FloatingPointError, OmegaConfBaseException, HydraException)
Task = Callable[[DictConfig], float | None]


def entry(task: Task) -> Callable[..., None]:
    """Make `task` a Hydra command over conf/config.yaml.

    What the task returns is handed to Hydra: a sweeper's objective.

    Returns:
        command(arguments, name): runs the task with the given words, or those of the command line, under the name that
        its messages begin with. It ends the process with status 2 after a user's mistake, in a job as well, and 130
        after Ctrl-C, with one line for each.
    """

    @functools.wraps(task)
    def command(arguments: Sequence[str] | None = None, name: str | None = None) -> None:
        line = sys.argv
        words = list(line[1:] if arguments is None else arguments)
        name = name or Path(line[0]).name
        with one_line_errors(name):
            register(overrides=words)
            sys.argv = [name.split()[0], *words]  # what Hydra reads; the job gets the command line back
            try:
                _check(words, name)
                main = hydra.main(version_base=VERSION_BASE, config_path=str(conf_folder()), config_name=MAIN)
                job = _Job(task, name, line)
                with errors_let_through(words):
                    main(job)()
            finally:
                sys.argv = line

    return command


class _Job:
    """A task as Hydra's launchers call it, here or in a process of their own."""

    def __init__(self, task: Task, name: str, line: list[str]):
        functools.update_wrapper(self, task)
        self.task, self.name, self.line = task, name, line
        self.tracebacks = os.environ.get("HYDRA_FULL_ERROR")

    def __call__(self, config: DictConfig) -> float | None:
        if multiprocessing.get_start_method(allow_none=True) == "loky":  # joblib's, unknown to a method's own processes
            multiprocessing.set_start_method("spawn", force=True)
        sys.argv = self.line  # with which Lightning starts its further processes
        resolvers()
        prepare_job(self.tracebacks)
        with one_line_errors(self.name, raised=queued()), end_left_to_queue():
            return self.task(config)


class one_line_errors:
    """Turns a user's mistake, or Ctrl-C, into one line on stderr and an exit status.

    Args:
        raised: raise the mistake after its line, as a ValueError that can be pickled, for the process that waits; of
            all other errors, leave the traceback on stderr, which a pickle would lose.
    """

    def __init__(self, name: str, raised: bool = False):
        self.name, self.raised = name, raised
        self.tracebacks = bool(os.environ.get("HYDRA_FULL_ERROR"))

    def __enter__(self) -> None:
        return None

    def __exit__(self, kind, error, trace) -> None:
        if isinstance(error, KeyboardInterrupt) or _ended_by_lightning(error):
            print(f"{self.name}: interrupted", file=sys.stderr)
            raise SystemExit(INTERRUPTED) from None
        text = None if self.tracebacks else _told(error)
        if text is not None:
            print(f"{self.name}: {text}", file=sys.stderr)
            raise (ValueError(text) if self.raised else SystemExit(USER_ERROR)) from None
        if self.raised and isinstance(error, Exception):
            traceback.print_exception(error)


def _told(error: BaseException | None) -> str | None:
    """What is to be said of a user's mistake, None for anything else."""
    if (text := told_by_queue(error)) is not None:
        return text
    if not isinstance(error, MISTAKES):
        return None
    text = str(error).strip()
    return text.splitlines()[0] if isinstance(error, OmegaConfBaseException) else text


def _ended_by_lightning(error: BaseException | None) -> bool:
    """Whether Lightning has turned Ctrl-C into the end of the process, without a word."""
    if not isinstance(error, SystemExit) or error.__suppress_context__:
        return False
    return isinstance(error.__context__, KeyboardInterrupt)


def _check(arguments: list[str], name: str) -> None:
    """Compose every single alternative of every override once, so that a sweep fails before its first job.

    Left to Hydra: what only asks for information, and a primary folder or rerun of the user's own.

    Raises:
        ValueError: naming the wrong override.
    """
    parser = get_args_parser()
    parser.prog = name
    options = parser.parse_args(arguments)
    asks = options.help or options.hydra_help or options.info or options.shell_completion
    if asks or options.config_path or options.experimental_rerun:
        return
    refuse_missing(options.overrides)
    folders = [options.config_dir] if options.config_dir else []
    main = options.config_name or MAIN
    fixed, choices = _choices(options, folders)
    load([*fixed, *(alternatives[0] for alternatives in choices)], folders, main)
    for number, alternatives in enumerate(choices):
        others = [each[0] for position, each in enumerate(choices) if position != number]
        for alternative in alternatives[1:]:
            load([*fixed, *others, alternative], folders, main)


def _choices(options: Namespace, folders: list[str]) -> tuple[list[str], list[list[str]]]:
    """The overrides that are the same in all jobs, and the alternatives of each that is swept.

    A sweep over an interval, which only some sweepers know, has none.
    """
    try:
        with hydra_apart():
            parsed = OverridesParser.create(loader(folders, options.overrides)).parse_overrides(options.overrides)
            swept = [each for each in parsed if each.is_sweep_override()]
            if not options.multirun and not any(each.startswith("hydra.mode=") for each in options.overrides):
                return options.overrides, []  # what a sweep needs is Hydra's to say
            discrete = [each for each in swept if each.is_discrete_sweep()]
            choices = [
                [f"{each.get_key_element()}={value}" for value in each.sweep_string_iterator()] for each in discrete
            ]
    except HydraException as error:
        raise ValueError(str(error)) from error
    for each, alternatives in zip(discrete, choices, strict=True):
        if not alternatives:
            raise ValueError(f"the sweep {each.input_line} matches nothing in {conf_folder()}")
    return [str(each.input_line) for each in parsed if not each.is_sweep_override()], choices
