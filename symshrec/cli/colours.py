"""Colours in a terminal, for plane numbers and errors alone."""

import os
from typing import TextIO

RED = "31"


def painted(text: str, colour: str, stream: TextIO) -> str:
    """Text in a colour where the stream is a terminal and NO_COLOR is unset (https://no-color.org), else as it is."""
    plain = os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb" or not stream.isatty()
    return text if plain else f"\033[{colour}m{text}\033[0m"
