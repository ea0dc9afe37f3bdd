"""A grid of cells as Markdown, readable in a terminal too, and as LaTeX."""

from collections.abc import Sequence
from dataclasses import dataclass

ESCAPES = {"&": r"\&", "%": r"\%", "_": r"\_", "#": r"\#", "$": r"\$"}
SYMBOLS = {
    "↑": r"$\uparrow$",
    "−": "$-$",
    "θ": r"$\theta$",
    "ε": r"$\varepsilon$",
    "°": r"$^\circ$",
    "–": "--",
    "§": r"\S",
}


@dataclass(frozen=True)
class Text:
    """One cell; `strong` marks the best of its column."""

    text: str
    strong: bool = False


@dataclass(frozen=True)
class Grid:
    """A headed grid. header (W,), rows of W cells each; the first `left` columns hold words, the others numbers."""

    heading: str
    header: Sequence[str]
    rows: Sequence[Sequence[Text]]
    left: int = 1


def markdown(grid: Grid) -> str:
    """The grid as a Markdown table under its heading, columns padded to line up in plain text."""
    body = [[f"**{cell.text}**" if cell.strong else cell.text for cell in row] for row in grid.rows]
    widths = [max(map(len, column)) for column in zip(grid.header, *body, strict=True)]
    lines = [_line(grid.header, widths, grid.left)]
    lines.append(_line(["-" * w if i < grid.left else "-" * (w - 1) + ":" for i, w in enumerate(widths)], widths, 0))
    lines += [_line(row, widths, grid.left) for row in body]
    return "\n".join([f"### {grid.heading}", "", *lines, ""])


def _line(cells: Sequence[str], widths: Sequence[int], left: int) -> str:
    padded = [c.ljust(w) if i < left else c.rjust(w) for i, (c, w) in enumerate(zip(cells, widths, strict=True))]
    return f"| {' | '.join(padded)} |"


def latex(grid: Grid, caption: str) -> str:
    """The grid as a booktabs table with `caption`, the best of each column bold; needs \\usepackage{booktabs}."""
    lines = [r"\begin{table}", r"\centering", rf"\caption{{{tex(caption)}}}"]
    lines.append(rf"\begin{{tabular}}{{{'l' * grid.left}{'r' * (len(grid.header) - grid.left)}}}")
    lines += [r"\toprule", " & ".join(map(tex, grid.header)) + r" \\", r"\midrule"]
    for number, row in enumerate(grid.rows):
        if number and row[0].text and not all(other[0].text for other in grid.rows):
            lines.append(r"\addlinespace")
        lines.append(" & ".join(rf"\textbf{{{tex(c.text)}}}" if c.strong else tex(c.text) for c in row) + r" \\")
    return "\n".join([*lines, r"\bottomrule", r"\end{tabular}", r"\end{table}", ""])


def tex(text: str) -> str:
    """Plain text with LaTeX's special characters escaped and our few symbols written as mathematics."""
    return "".join(ESCAPES.get(c) or SYMBOLS.get(c, c) for c in text)
