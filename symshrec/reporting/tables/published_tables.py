"""Tables 2–4: ours, published and difference side by side, and below each what its two metrics hide; and our own."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from symshrec.benchmark.cloud import SOLIDS
from symshrec.metrics import METRICS
from symshrec.reporting.tables.documents import Page, csv_text, write_pages
from symshrec.reporting.tables.layouts import (
    HARD_DOCUMENT,
    PAPER_DOCUMENTS,
    SCAN_DOCUMENT,
    SO3_DOCUMENT,
    TIGHT_DOCUMENT,
    Document,
    Layout,
)
from symshrec.reporting.tables.published import published_cells, published_methods
from symshrec.reporting.tables.results import (
    HIDDEN_METRICS,
    LABELS,
    PUBLISHED_METRICS,
    TIGHT_EPSILON,
    TIGHT_THETA_DEG,
    check_comparable,
    find_score,
    is_oracle,
    provenance,
    scored_at,
)
from symshrec.reporting.tables.sampling import sampling_note
from symshrec.reporting.tables.sweep import sweep_grids, sweep_rows, swept
from symshrec.reporting.tables.typeset import Grid, Text

CSV_COLUMNS = ("table", "method", "metric", "group", "ours", "published", "difference")
SWEEP_COLUMNS = ("method", "metric", "theta_deg", "epsilon", "ours")
HIDES = (
    "Bold: the best of ours. mAP and PHC forgive every missed plane. Recall-aware mAP divides by the number of "
    "true planes; count accuracy is the share of clouds with exactly the right number of planes."
)
ORACLE = (
    "{} is no method and never bold: told the true planes, it shows what estimating them from the points loses even "
    "when the search is perfect."
)


@dataclass(frozen=True)
class Cell:
    """One score in [0, 1]: ours (None without a run or without such a cloud) and published (None without a row).

    oracle: whether ours is of a run that was told the truth.
    """

    table: int | str
    method: str
    metric: str
    group: str
    ours: float | None
    published: float | None
    oracle: bool = False

    @property
    def difference(self) -> float | None:
        """Ours minus published; None where either is."""
        return None if self.ours is None or self.published is None else self.ours - self.published


def methods(layout: Layout, results: Sequence[dict]) -> list[str]:
    """The rows: the published runs in the paper's order, where it has the table, then ours in the order given."""
    published = published_methods() if layout.published else ()
    return list(dict.fromkeys([*published, *(result["name"] for result in results)]))


def cells(layout: Layout, metric: str, results: Sequence[dict]) -> dict[str, list[Cell]]:
    """Each method's row of the table for one metric, in the layout's group order.

    Raises:
        ValueError: naming file, metric and group of a score that a result lacks.
    """
    by_name, published = {result["name"]: result for result in results}, published_cells()
    tolerances = layout.theta_deg, layout.epsilon
    return {
        method: [
            Cell(
                *(layout.table, method, metric, group),
                ours=find_score(by_name[method], metric, group, *tolerances) if method in by_name else None,
                published=published.get((layout.table, method, metric, group)),
                oracle=method in by_name and is_oracle(by_name[method]),
            )
            for group in layout.groups
        ]
        for method in methods(layout, results)
    }


def table_rows(layout: Layout, results: Sequence[dict]) -> Iterator[tuple]:
    """The CSV rows of one table, CSV_COLUMNS each, the hidden metrics after the published ones; None for a blank."""
    for metric in METRICS:
        for row in cells(layout, metric, results).values():
            for cell in row:
                if cell.ours is not None or cell.published is not None:
                    numbers = (cell.ours, cell.published, cell.difference)
                    yield cell.table, cell.method, metric, cell.group, *map(_rounded, numbers)


def table_grids(layout: Layout, results: Sequence[dict]) -> list[Grid]:
    """The printed grids of one table: the paper's own first, then what they hide; of ours one grid a metric."""
    if not layout.published:
        return [_metric_grid(f"{_label(metric)} ↑ {layout.caption}", layout, metric, results) for metric in METRICS]
    if layout.groups.keys() == {"all"}:
        return [_overall_grid(layout, results), _hidden_grid(layout, results)]
    grids = [_stacked_grid(layout, metric, results) for metric in PUBLISHED_METRICS]
    for metric in HIDDEN_METRICS:
        grids.append(_metric_grid(f"What these figures hide: {_label(metric)} ↑", layout, metric, results))
    return [*grids, _solid_grid(layout, results)] if layout.table == 4 else grids


def _overall_grid(layout: Layout, results: Sequence[dict]) -> Grid:
    by_metric = {metric: cells(layout, metric, results) for metric in PUBLISHED_METRICS}
    rows = [[Text(method)] for method in methods(layout, results)]
    for by_method in by_metric.values():
        best = _best([cell for (cell,) in by_method.values()])
        for row, (cell,) in zip(rows, by_method.values(), strict=True):
            row += [_ours(cell, layout.decimals, best), _text(cell.published, layout.decimals)]
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
            "ours": [_ours(cell, layout.decimals, b) for cell, b in zip(row, best, strict=True)],
            "published": [_text(cell.published, layout.decimals) for cell in row],
            "difference": [_text(cell.difference, layout.decimals, signed=True) for cell in row],
        }
        filled = {kind: texts for kind, texts in kinds.items() if any(each.text for each in texts)}
        for place, (kind, texts) in enumerate(filled.items()):
            rows.append([Text("" if place else method), Text(kind), *texts])
    return Grid(f"{metric} ↑", ["method", "", *layout.groups.values()], rows, left=2)


def _hidden_grid(layout: Layout, results: Sequence[dict]) -> Grid:
    """The hidden metrics of our rows, a column each, over the layout's only group."""
    by_metric = [cells(layout, metric, results) for metric in HIDDEN_METRICS]
    rows = {name: [by_method[name][0] for by_method in by_metric] for name in _names(results)}
    return _ours_grid("What these figures hide", [f"{_label(metric)} ↑" for metric in HIDDEN_METRICS], rows, layout)


def _metric_grid(title: str, layout: Layout, metric: str, results: Sequence[dict]) -> Grid:
    """One metric of our rows over the layout's groups."""
    by_method = cells(layout, metric, results)
    return _ours_grid(title, layout.groups.values(), {name: by_method[name] for name in _names(results)}, layout)


def _ours_grid(title: str, columns: Iterable[str], rows: dict[str, list[Cell]], layout: Layout) -> Grid:
    """Our rows alone: method → its cells."""
    best = [_best(column) for column in zip(*rows.values(), strict=True)]
    body = [
        [Text(name), *(_ours(cell, layout.decimals, b) for cell, b in zip(row, best, strict=True))]
        for name, row in rows.items()
    ]
    return Grid(title, ["method", *columns], body)


def _solid_grid(layout: Layout, results: Sequence[dict]) -> Grid:
    rows = []
    for result in results:
        for place, solid in enumerate(SOLIDS):
            values = [_text(find_score(result, metric, solid), layout.decimals) for metric in METRICS]
            rows.append([Text("" if place else result["name"]), Text(solid), *values])
    return Grid("Cylinders and cones", ["method", "", *(f"{_label(m)} ↑" for m in METRICS)], rows, left=2)


def _best(column: Sequence[Cell]) -> float | None:
    """The highest of our methods', to be printed bold; None where there is nothing to compare."""
    ours = [cell.ours for cell in column if cell.ours is not None and not cell.oracle]
    return max(ours) if len(ours) > 1 else None


def _ours(cell: Cell, decimals: int, best: float | None) -> Text:
    return _text(cell.ours, decimals, None if cell.oracle else best)


def _text(value: float | None, decimals: int, best: float | None = None, signed: bool = False) -> Text:
    if value is None:
        return Text("")
    value = round(value, decimals) + 0.0
    printed = f"{value:{'+' if signed else ''}.{decimals}f}".replace("-", "−")
    return Text(printed, strong=best is not None and value == round(best, decimals))


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 6) + 0.0


def _names(results: Sequence[dict]) -> list[str]:
    return [result["name"] for result in results]


def _label(metric: str) -> str:
    return LABELS.get(metric, metric)


def write_tables(
    results: Sequence[dict],
    folder: Path,
    hard: Sequence[dict] = (),
    so3: Sequence[dict] = (),
    scan: Sequence[dict] = (),
    missing: Mapping[str, Sequence[str]] = MappingProxyType({}),
) -> tuple[list[Path], str]:
    """Write table2, table3, table4 as .md, .csv and .tex, and those of ours that there are results for.

    table_tight where results were scored ten times tighter too, sweep where at more tolerances than that, table_hard,
    table_scan and table_so3 from the results on other data.

    Args:
        results: metrics.json dictionaries (`results.read_result`), one per row, in row order, on the same data.
        folder: made where missing; each file is replaced in one step.
        hard, so3, scan: likewise, on data of P6–P9, on data under full rotations, and on data of P10–P15.
        missing: runs to name below the tables as not run: `main` for those on the same data, `hard`, `scan`, `so3`.

    Returns:
        The files written, and the tables as text to print.

    Raises:
        ValueError: for no results, two of one name, differing data, or a missing score (file, metric and group named).
    """
    tight = [result for result in results if scored_at(result, TIGHT_THETA_DEG, TIGHT_EPSILON)]
    beside = (
        (TIGHT_DOCUMENT, tight, "main"),
        (HARD_DOCUMENT, hard, "hard"),
        (SCAN_DOCUMENT, scan, "scan"),
        (SO3_DOCUMENT, so3, "so3"),
    )
    pages = [_page(document, results, missing.get("main", ())) for document in PAPER_DOCUMENTS]
    pages += [_page(document, own, missing.get(name, ())) for document, own, name in beside if own]
    if several := swept(results):
        title, text = "Tolerance sweep: how mAP depends on θ and ε", csv_text(SWEEP_COLUMNS, sweep_rows(several))
        pages.append(Page("sweep", title, sweep_grids(several), _note(several), provenance(several), text))
    return write_pages(pages, folder)


def _page(document: Document, results: Sequence[dict], missing: Sequence[str] = ()) -> Page:
    check_comparable(results)
    grids = [grid for layout in document.layouts for grid in table_grids(layout, results)]
    rows = (row for layout in document.layouts for row in table_rows(layout, results))
    note = " ".join(filter(None, (_note(results, missing), sampling_note(results, document.layouts))))
    table = csv_text(CSV_COLUMNS, rows)
    return Page(document.name, document.title, grids, note, provenance(results), table)


def _note(results: Sequence[dict], missing: Sequence[str] = ()) -> str:
    oracles = (ORACLE.format(result["name"]) for result in results if is_oracle(result))
    return " ".join([HIDES, *oracles, *([f"Not run: {', '.join(missing)}."] if missing else [])])
