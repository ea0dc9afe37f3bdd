"""What a refinement does to the planes of a method: angle and offset errors of the same planes before and after."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from symshrec.benchmark.cloud import PERTURBATIONS
from symshrec.metrics import group_masks, plane_errors
from symshrec.reporting.tables.compared import Compared
from symshrec.reporting.tables.documents import Page, csv_text, write_pages
from symshrec.reporting.tables.typeset import Grid, Text

REFINED = "_refine"  # ends the folder name of a run with refinement
THETA_DEG, EPSILON = 5.0, 0.05  # loose, so that a plane is found again however much it moved
STATISTICS: dict[str, Callable] = {"median": np.median, "mean": np.mean}
QUANTITIES = ("angle", "offset")
COLUMNS = ("method", "group", "planes", "lost", "gained", "quantity", "statistic", "before", "after")


@dataclass(frozen=True, eq=False)
class Refinement:
    """Errors of the n true planes that were found both before and after, each array (n, 2): before, after.

    angles_deg between the normals. offsets as shares of the diagonal. clouds (n,): whose planes they are.
    lost, gained: clouds of the true planes found only before, and only after.
    """

    angles_deg: np.ndarray
    offsets: np.ndarray
    clouds: np.ndarray
    lost: np.ndarray
    gained: np.ndarray


def refinement_errors(before: Compared, after: Compared) -> Refinement:
    """Match both to the true planes at 5° and 5% of the diagonal, and compare on the planes that both found.

    Args:
        before, after: of the same clouds, without and with refinement.
    """
    found = [plane_errors(run.predicted, run.truth, run.diagonals, THETA_DEG, EPSILON) for run in (before, after)]
    true_planes = [each.true_planes for each in found]
    _, *rows = np.intersect1d(true_planes[0], true_planes[1], return_indices=True)
    lost, gained = (~np.isin(own, other) for own, other in (true_planes, true_planes[::-1]))
    pairs = list(zip(found, rows, strict=True))
    return Refinement(
        np.stack([each.angles_deg[row] for each, row in pairs], axis=1),
        np.stack([each.offsets[row] for each, row in pairs], axis=1),
        found[0].clouds[rows[0]],
        found[0].clouds[lost],
        found[1].clouds[gained],
    )


def write_refinement(runs: Mapping[str, Compared], folder: Path, footer: str) -> tuple[list[Path], str]:
    """Write refinement.md, .csv and .tex, a row for every perturbation, where a run has run with refinement too.

    Args:
        runs: by folder name; <name> and <name>_refine belong together. footer: where the numbers come from.

    Returns:
        The files written, none where there is no such pair, and the page as text to print.
    """
    pairs = [(run, runs[f"{name}{REFINED}"]) for name, run in runs.items() if f"{name}{REFINED}" in runs]
    if not pairs:
        return [], ""
    title = f"Before and after refinement: true planes found both times within {THETA_DEG:g}° and {100 * EPSILON:g}%"
    note = (
        "Angles in degrees, offsets in % of the cloud's diagonal; bold: better than before. "
        "Lost and gained: true planes found within these bounds only before and only after."
    )
    rows = [row for pair in pairs for row in refinement_rows(*pair)]
    grids = [_grid(after.name, [row for row in rows if row[0] == after.name]) for _, after in pairs]
    return write_pages([Page("refinement", title, grids, note, footer, csv_text(COLUMNS, rows))], folder)


def refinement_rows(before: Compared, after: Compared) -> Iterator[tuple]:
    """COLUMNS for all clouds and each perturbation with planes to compare, quantity and statistic; offsets in %."""
    errors = refinement_errors(before, after)
    values = {"angle": errors.angles_deg, "offset": 100 * errors.offsets}
    masks = group_masks(after.labels)
    for group, mask in ((group, masks[group]) for group in ("all", *PERTURBATIONS) if group in masks):
        rows = mask[errors.clouds]
        counts = int(rows.sum()), int(mask[errors.lost].sum()), int(mask[errors.gained].sum())
        for quantity, both in values.items():
            for name, statistic in STATISTICS.items():
                if rows.any():
                    errors_of_group = (round(float(each), 6) for each in statistic(both[rows], axis=0))
                    yield after.name, group, *counts, quantity, name, *errors_of_group


def _grid(name: str, rows: Sequence[tuple]) -> Grid:
    header = [f"{statistic} {quantity}" for quantity in QUANTITIES for statistic in STATISTICS]
    header = [word for each in header for word in (f"{each}, before", "after")]
    by_group = {}
    for _, group, *counts, _, _, before, after in rows:
        cells = by_group.setdefault(group, [Text(group), *(Text(f"{count:,}") for count in counts)])
        cells += [Text(f"{before:.4f}"), Text(f"{after:.4f}", strong=after < before)]
    return Grid(name, ["clouds", "planes", "lost", "gained", *header], list(by_group.values()))
