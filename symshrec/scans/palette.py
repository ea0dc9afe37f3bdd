"""The colours of planes, the same in tables, pictures, pages and windows: safe for the colour-blind."""

from symshrec.planes import Planes, PointGroup

COLOURS = {
    "vermilion": "#d55e00",
    "blue": "#0072b2",
    "green": "#009e73",
    "pink": "#cc79a7",
    "orange": "#e69f00",
    "sky": "#56b4e9",
    "olive": "#8a8a2c",
    "plum": "#882255",
}  # after Okabe and Ito; olive and plum, of Tol's, in place of a yellow that no paper shows and of the points' black


TERMINAL = (166, 25, 36, 175, 172, 74, 100, 89)  # the same, of the 256 that terminals have


def colour_number(planes: Planes, group: PointGroup, row: int) -> int:
    """The number that the plane at a place has its colour by: its own, from 1 on.

    Planes of a surface of revolution stand for infinitely many: all through its axis have the first colour, and the one
    across it the second.
    """
    if not group.continuous or row in group.outside:
        return row + 1
    return 2 if group.axes and abs(planes.normals[row] @ group.axes[0].direction) > 0.5 else 1


def colour_name(number: int) -> str:
    """The name of the colour of the plane of a number, from 1 on; after the last they begin again."""
    return list(COLOURS)[(number - 1) % len(COLOURS)]


def colour_code(number: int) -> str:
    """The same colour as #rrggbb."""
    return COLOURS[colour_name(number)]


def colour_escape(number: int) -> str:
    """The same colour, bold, for a terminal, as in `\\033[…m`."""
    return f"1;38;5;{TERMINAL[(number - 1) % len(TERMINAL)]}"
