"""Kinds of arguments that several commands take."""

import argparse
import math

import yaml

from symshrec.methods import DEFAULT
from symshrec.scans import SAMPLES


def add_detection(parser: argparse.ArgumentParser) -> None:
    """The arguments that choose a method, what counts as a plane, and how a mesh becomes points."""
    parser.add_argument("--method", default=DEFAULT, help=f"one of conf/method ({DEFAULT})")
    parser.add_argument(
        "--set", nargs="+", type=setting, action="extend", default=[], metavar="NAME=VALUE", help="of the method's own"
    )
    parser.add_argument("--min-confidence", type=share, help="least confidence of a plane (the method's own threshold)")
    parser.add_argument("--samples", type=count, default=SAMPLES, help=f"points drawn on a mesh ({SAMPLES})")
    parser.add_argument("--seed", type=whole, default=0, help="of those points (0)")


def count(text: str) -> int:
    """A whole number from 1 on."""
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number from 1 on")
    return int(text)


def whole(text: str) -> int:
    """A whole number from 0 on."""
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number from 0 on")
    return int(text)


def angle(text: str) -> float:
    """Degrees from 0 to 90."""
    return _between(text, 90)


def tolerance(text: str) -> float:
    """Degrees above 0 and up to 5, of planes that make a group."""
    if (value := _between(text, 5)) == 0:
        raise argparse.ArgumentTypeError(f"{text!r} is not above 0")
    return value


def share(text: str) -> float:
    """A finite number from 0 on."""
    return _between(text, math.inf)


def factor(text: str) -> float:
    """A finite number above 0."""
    if (value := _between(text, math.inf)) == 0:
        raise argparse.ArgumentTypeError(f"{text!r} is not above 0")
    return value


def setting(text: str) -> tuple[str, object]:
    """NAME=VALUE, the value as in YAML."""
    name, found, value = text.partition("=")
    if not found or not name.isidentifier():
        raise argparse.ArgumentTypeError(f"{text!r} is not of the form NAME=VALUE")
    try:
        return name, yaml.safe_load(value)
    except yaml.YAMLError:
        raise argparse.ArgumentTypeError(f"{value!r} is no value for {name}") from None


def _between(text: str, most: float) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0 <= value <= most or math.isinf(value):
        raise argparse.ArgumentTypeError(
            f"{text!r} is not a number from 0 {'on' if math.isinf(most) else f'to {most}'}"
        )
    return value
