"""Tables 2–4: ours, published and difference side by side, and below each what its two metrics hide."""

import csv
import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from symshrec.benchmark.cloud import FAMILIES, PERTURBATIONS, SOLIDS
from symshrec.benchmark.storage import write_atomically
from symshrec.reporting.published import published_cells, published_methods
from symshrec.reporting.results import (
    HIDDEN_METRICS,
    LABELS,
    PUBLISHED_METRICS,
    check_comparable,
    find_score,
    provenance,
)
from symshrec.reporting.sweep import sweep_grids, sweep_rows, swept
from symshrec.reporting.typeset import Grid, Text, latex, markdown

CSV_COLUMNS = ("table", "method", "metric", "group", "ours", "published", "difference")
TOLERANCES = "θ = 1°, ε = 1% of the cloud's diagonal"
HIDES = (
    "Bold: the best of ours. mAP and PHC forgive every missed plane. Recall-aware mAP divides by the number of "
    "true planes; count accuracy is the share of clouds with exactly the right number of planes."
)


@dataclass(frozen=True)
class Layout:
    """One of the paper's tables: its number, caption, columns (group → printed name) and printed decimals."""

    number: int
    caption: str
    groups: dict[str, str]
    decimals: int


LAYOUTS = (
    Layout(2, f"overall performance at {TOLERANCES}", {"all": "all"}, 4),
    Layout(3, f"performance per perturbation at {TOLERANCES}", {name: name for name in PERTURBATIONS}, 3),
    Layout(
        4,
        f"performance per family of shapes at {TOLERANCES}",
        {name: f"S{i} {name.replace('_', ' ')}" for i, name in enumerate(FAMILIES, 1)},
        4,
    ),
)


@dataclass(frozen=True)
class Cell:
    """One score in [0, 1]: ours (None without a run or without such a cloud) and published (None without a row)."""

    table: int
    method: str
    metric: str
    group: str
    ours: float | None
    published: float | None

    @property
    def difference(self) -> float | None:
        """Ours minus published; None where either is."""
        return None if self.ours is None or self.published is None else self.ours - self.published


def methods(results: Sequence[dict]) -> list[str]:
    """The rows: the published runs in the paper's order, then ours that the paper has not, in the order given."""
    return list(dict.fromkeys([*published_methods(), *(result["name"] for result in results)]))


def cells(layout: Layout, metric: str, results: Sequence[dict]) -> dict[str, list[Cell]]:
    """Each method's row of the table for one metric, in the layout's group order.

    Raises:
        ValueError: naming file, metric and group of a score that a result lacks.
    """
    by_name, published = {result["name"]: result for result in results}, published_cells()
    return {
        method: [
            Cell(
                *(layout.number, method, metric, group),
                ours=find_score(by_name[method], metric, group) if method in by_name else None,
                published=published.get((layout.number, method, metric, group)),
            )
            for group in layout.groups
        ]
        for method in methods(results)
    }


def table_rows(layout: Layout, results: Sequence[dict]) -> Iterator[tuple]:
    """The CSV rows of one table, CSV_COLUMNS each, the hidden metrics after the published ones; None for a blank."""
    for metric in PUBLISHED_METRICS + HIDDEN_METRICS:
        for row in cells(layout, metric, results).values():
            for cell in row:
                if cell.ours is not None or cell.published is not None:
                    numbers = (cell.ours, cell.published, cell.difference)
                    yield cell.table, cell.method, metric, cell.group, *map(_rounded, numbers)


def table_grids(layout: Layout, results: Sequence[dict]) -> list[Grid]:
    """The printed grids of one table: the paper's own first, then what they hide."""
    names = [result["name"] for result in results]
    hidden = {metric: cells(layout, metric, results) for metric in HIDDEN_METRICS}
    if layout.groups.keys() == {"all"}:
        return [_overall_grid(layout, results), _ours_grid("What these figures hide", hidden, names, layout.decimals)]
    grids = [_stacked_grid(layout, metric, results) for metric in PUBLISHED_METRICS]
    labels = list(layout.groups.values())
    for metric, rows in hidden.items():
        title = f"What these figures hide: {LABELS.get(metric, metric)} ↑"
        columns = {label: {name: [row[i]] for name, row in rows.items()} for i, label in enumerate(labels)}
        grids.append(_ours_grid(title, columns, names, layout.decimals, arrow=""))
    return [*grids, _solid_grid(layout, results)] if layout.number == 4 else grids


def _overall_grid(layout: Layout, results: Sequence[dict]) -> Grid:
    by_metric = {metric: cells(layout, metric, results) for metric in PUBLISHED_METRICS}
    rows = [[Text(method)] for method in methods(results)]
    for by_method in by_metric.values():
        best = _best([cell for (cell,) in by_method.values()])
        for row, (cell,) in zip(rows, by_method.values(), strict=True):
            row += [_text(cell.ours, layout.decimals, best), _text(cell.published, layout.decimals)]
            row.append(_text(cell.difference, layout.decimals, signed=True))
    header = ["method", *(name for m in PUBLISHED_METRICS for name in (f"{m} ↑ ours", "published", "difference"))]
    return Grid("mAP and PHC", header, rows)


def _stacked_grid(layout: Layout, metric: str, results: Sequence[dict]) -> Grid:
    """Ours, published and difference below one another, so that the columns stay the paper's."""
    by_method = cells(layout, metric, results)
    best = [_best(column) for column in zip(*by_method.values(), strict=True)]
    rows = []
    for method, row in by_method.items():
        kinds = {
            "ours": [_text(cell.ours, layout.decimals, b) for cell, b in zip(row, best, strict=True)],
            "published": [_text(cell.published, layout.decimals) for cell in row],
            "difference": [_text(cell.difference, layout.decimals, signed=True) for cell in row],
        }
        filled = {kind: texts for kind, texts in kinds.items() if any(each.text for each in texts)}
        for place, (kind, texts) in enumerate(filled.items()):
            rows.append([Text("" if place else method), Text(kind), *texts])
    return Grid(f"{metric} ↑", ["method", "", *layout.groups.values()], rows, left=2)


def _ours_grid(title: str, columns: dict, names: Sequence[str], decimals: int, arrow: str = " ↑") -> Grid:
    """Our rows alone; columns: printed name → method → [cell]."""
    best = [_best([column[name][0] for name in names]) for column in columns.values()]
    rows = [
        [Text(n), *(_text(c[n][0].ours, decimals, b) for c, b in zip(columns.values(), best, strict=True))]
        for n in names
    ]
    return Grid(title, ["method", *(f"{LABELS.get(name, name)}{arrow}" for name in columns)], rows)


def _solid_grid(layout: Layout, results: Sequence[dict]) -> Grid:
    metrics = PUBLISHED_METRICS + HIDDEN_METRICS
    rows = []
    for result in results:
        for place, solid in enumerate(SOLIDS):
            values = [_text(find_score(result, metric, solid), layout.decimals) for metric in metrics]
            rows.append([Text("" if place else result["name"]), Text(solid), *values])
    return Grid("Cylinders and cones", ["method", "", *(f"{LABELS.get(m, m)} ↑" for m in metrics)], rows, left=2)


def _best(column: Sequence[Cell]) -> float | None:
    """The highest of ours, to be printed bold; None where there is nothing to compare."""
    ours = [cell.ours for cell in column if cell.ours is not None]
    return max(ours) if len(ours) > 1 else None


def _text(value: float | None, decimals: int, best: float | None = None, signed: bool = False) -> Text:
    if value is None:
        return Text("")
    value = round(value, decimals) + 0.0
    printed = f"{value:{'+' if signed else ''}.{decimals}f}".replace("-", "−")
    return Text(printed, strong=best is not None and value == round(best, decimals))


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 6) + 0.0


def write_tables(results: Sequence[dict], folder: Path) -> tuple[list[Path], str]:
    """Write table2, table3, table4 (and sweep, where a result holds several tolerances) as .md, .csv and .tex.

    Args:
        results: metrics.json dictionaries (`results.read_result`), one per row, in row order, on the same data.
        folder: made where missing; each file is replaced in one step.

    Returns:
        The files written, and the tables as text to print.

    Raises:
        ValueError: for no results, two of one name, differing data, or a missing score (file, metric and group named).
    """
    check_comparable(results)
    documents = [
        (
            f"table{layout.number}",
            f"SHREC 2023, Table {layout.number}: {layout.caption}",
            HIDES,
            table_grids(layout, results),
        )
        for layout in LAYOUTS
    ]
    csv_texts = {f"table{layout.number}": csv_text(CSV_COLUMNS, table_rows(layout, results)) for layout in LAYOUTS}
    if several := swept(results):
        documents.append(("sweep", "Tolerance sweep: how mAP depends on θ and ε", HIDES, sweep_grids(several)))
        csv_texts["sweep"] = csv_text(("method", "metric", "theta_deg", "epsilon", "ours"), sweep_rows(several))
    folder, footer = Path(folder), provenance(results)
    folder.mkdir(parents=True, exist_ok=True)
    paths, printed = [], []
    for name, title, note, grids in documents:
        text = "\n".join([f"## {title}\n", *map(markdown, grids), f"{note}\n", f"{footer}\n"])
        typeset = "\n".join(latex(grid, f"{title}. {grid.heading}. {footer}") for grid in grids)
        for suffix, content in ((".md", text), (".csv", csv_texts[name]), (".tex", typeset)):
            paths.append(folder / f"{name}{suffix}")
            write_atomically(paths[-1], content.encode())
        printed.append(text)
    return paths, "\n".join(printed)


def csv_text(columns: Sequence[str], rows: Iterator[tuple]) -> str:
    """Rows under their column names as CSV; None becomes an empty field."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(rows)
    return stream.getvalue()
