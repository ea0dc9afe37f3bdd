"""§5 A page of tables as three files: Markdown to read, CSV to compute with, LaTeX to print."""

import csv
import io
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from symshrec.files.atomic import write_atomically
from symshrec.reporting.tables.typeset import Grid, latex, markdown


@dataclass(frozen=True)
class Page:
    """What one set of files holds.

    name: of the files, without suffix. note: below the grids. footer: where the numbers come from.
    table: the CSV file's text.
    """

    name: str
    title: str
    grids: Sequence[Grid]
    note: str
    footer: str
    table: str


def write_pages(pages: Sequence[Page], folder: Path) -> tuple[list[Path], str]:
    """Write every page as .md, .csv and .tex into `folder`, made where missing, each file in one step.

    Returns:
        The files written, and the pages as text to print.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    paths, printed = [], []
    for page in pages:
        text = "\n".join([f"## {page.title}\n", *map(markdown, page.grids), f"{page.note}\n", f"{page.footer}\n"])
        typeset = "\n".join(latex(grid, f"{page.title}. {grid.heading}. {page.footer}") for grid in page.grids)
        for suffix, content in ((".md", text), (".csv", page.table), (".tex", typeset)):
            paths.append(folder / f"{page.name}{suffix}")
            write_atomically(paths[-1], content.encode())
        printed.append(text)
    return paths, "\n".join(printed)


def csv_text(columns: Sequence[str], rows: Iterable[tuple]) -> str:
    """Rows under their column names as CSV; None becomes an empty field."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(rows)
    return stream.getvalue()
