"""Shell completion: `eval "$(symshrec --shell-completion install=bash)"`, Hydra's own, for every command's settings."""

import os
from collections.abc import Sequence
from importlib import import_module

from symshrec.cli import BENCHMARK, COMMANDS


def complete(words: Sequence[str]) -> None:
    """Do what `--shell-completion` and its subcommand ask: install, uninstall, or a query about $COMP_LINE.

    A query about the first word is answered with commands; about the rest, by Hydra, with the command left out.
    """
    command, asks = "evaluate", any(word.startswith("query=") for word in words)
    if asks:
        typed = os.environ.get("COMP_LINE", "").partition(" ")[2].lstrip()
        command, gap, rest = typed.partition(" ")
        if not gap:
            print(" ".join(name for name in COMMANDS if name.startswith(command)))
            return
        if command not in BENCHMARK:  # files, which the shell completes itself
            return
        os.environ["COMP_LINE"] = f"symshrec {rest}"
    import_module(f"symshrec.cli.{command}").command(words, "symshrec")
