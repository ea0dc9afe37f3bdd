"""The colours of planes, the same in tables, pictures, pages and windows: safe for the colour-blind."""

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


def colour_name(number: int) -> str:
    """The name of the colour of the plane of a number, from 1 on; after the last they begin again."""
    return list(COLOURS)[(number - 1) % len(COLOURS)]


def colour_code(number: int) -> str:
    """The same colour as #rrggbb."""
    return COLOURS[colour_name(number)]
