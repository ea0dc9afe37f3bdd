"""The command line, for people with their own clouds or results: `symshrec detect`, `view`, `score`, `export`."""

import argparse
import os
import sys
from collections.abc import Sequence
from importlib import import_module

COMMANDS = {
    "detect": "find the mirror planes of clouds and meshes",
    "view": "look at a cloud and its planes, true and predicted, in a window",
    "score": "score a folder of results as the track's organisers did",
    "export": "write shards or predictions as the track's own text files",
}  # one module each, imported when it is asked for, so that nobody waits for another command's imports
USER_ERROR, INTERRUPTED, UNREAD = 2, 130, 141


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit code: 0, 2 for a user's error told in a line, 130 where interrupted, and
    141 where whoever read the output, such as `head`, wanted no more of it."""
    arguments = _parser().parse_args(argv)
    command = import_module(f"{__name__}.{arguments.command}")
    options = command.parser().parse_args(arguments.rest)
    try:
        command.run(options)
        sys.stdout.flush()
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # where Python writes what is left at its end
        return UNREAD
    except (ValueError, OSError) as error:
        print(f"symshrec {arguments.command}: {error}", file=sys.stderr)
        return USER_ERROR
    except KeyboardInterrupt:
        print(f"symshrec {arguments.command}: interrupted", file=sys.stderr)
        return INTERRUPTED
    return 0


def _parser() -> argparse.ArgumentParser:
    width = max(map(len, COMMANDS))
    parser = argparse.ArgumentParser(
        prog="symshrec",
        description="Reflection symmetries of 3D point clouds: found, looked at and scored.",
        epilog="commands:\n" + "\n".join(f"  {name:{width}}  {purpose}" for name, purpose in COMMANDS.items()),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("command", choices=COMMANDS, metavar="COMMAND", help="one of the commands below")
    parser.add_argument("rest", nargs=argparse.REMAINDER, metavar="...", help="its arguments; try --help there")
    return parser
