"""The command line: `symshrec detect`, `symmetrise`, `complete`, `align`, `view`, `score` and `export` for people's own
clouds and results, and the benchmark's `generate`, `train`, `evaluate`, `tables`, `reproduce`, `figures` and `bench`,
which are Hydra commands over conf/."""

import argparse
import os
import sys
from collections.abc import Sequence
from importlib import import_module
from textwrap import fill

from symshrec import __version__
from symshrec.cli.colours import RED, painted

OWN = {
    "detect": "find the mirror planes of clouds and meshes",
    "symmetrise": "average a cloud or a mesh with its mirror images",
    "complete": "fill the missing side of a scan from its mirror image",
    "align": "bring a cloud or a mesh upright by its planes",
    "view": "look at a cloud and its planes, true and predicted, in a window",
    "score": "score a folder of results as the track's organisers did",
    "export": "write shards or predictions as the track's own text files",
}
BENCHMARK = {
    "generate": "make the benchmark's clouds, or what is missing of them",
    "train": "train a method, or go on where it was",
    "evaluate": "run a method over the test clouds and score it",
    "tables": "write the paper's tables from finished runs, ours beside the published",
    "reproduce": "make the paper's tables from nothing: data, all runs, tables, of which only what is missing",
    "figures": "draw the paper's figures from our own clouds",
    "bench": "time everything as ratios within one run",
}  # with settings as KEY=VALUE
COMMANDS = OWN | BENCHMARK  # one module each, imported when it is asked for: nobody waits for another's imports
USER_ERROR, INTERRUPTED, UNREAD = 2, 130, 141
EXIT_STATUSES = (
    f"Exit status: 0 where all went well; {USER_ERROR} for wrong arguments or input, named in a line; "
    f"{INTERRUPTED} where it was interrupted; {UNREAD} where nobody read the output to its end."
)


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit status, one of EXIT_STATUSES. 141 is for readers of the output such as `head`,
    who want no more of it."""
    name = "symshrec"
    try:
        words = sys.argv[1:] if argv is None else list(argv)
        if words[:1] in (["-sc"], ["--shell-completion"]):
            import_module(f"{__name__}.completion").complete(words)
            return 0
        arguments = _parser().parse_args(words)
        name = f"symshrec {arguments.command}"
        _run(arguments.command, arguments.rest, name)
        sys.stdout.flush()
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # where Python writes what is left at its end
        return UNREAD
    except (ValueError, OSError) as error:
        print(f"{painted(f'{name}:', RED, sys.stderr)} {error}", file=sys.stderr)
        return USER_ERROR
    except KeyboardInterrupt:
        print(f"{name}: interrupted", file=sys.stderr)
        return INTERRUPTED
    return 0


def _run(command: str, rest: Sequence[str], name: str) -> None:
    module = import_module(f"{__name__}.{command}")
    if command in OWN:
        module.run(module.parser().parse_args(rest))
        return
    if {"--help", "-h"} & set(rest):
        print(f"usage: {name} [--multirun] [KEY=VALUE ...]\n\n{BENCHMARK[command].capitalize()}.\n")
    module.command(rest, name)


def _listed(commands: dict[str, str]) -> str:
    width = max(map(len, COMMANDS))
    return "\n".join(f"  {name:{width}}  {purpose}" for name, purpose in commands.items())


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="symshrec",
        description="Reflection symmetries of 3D point clouds: found, looked at, scored and learnt.",
        epilog=f"for your own clouds and results:\n{_listed(OWN)}\n\n"
        f"for the benchmark, with settings of conf/ as KEY=VALUE:\n{_listed(BENCHMARK)}\n\n{fill(EXIT_STATUSES, 79)}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("-V", "--version", action="version", version=f"symshrec {__version__}")
    parser.add_argument("command", choices=COMMANDS, metavar="COMMAND", help="one of the commands below")
    parser.add_argument("rest", nargs=argparse.REMAINDER, metavar="...", help="its arguments; try --help there")
    return parser
