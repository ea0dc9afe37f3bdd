"""§5 M3's published Tables 3 and 4 as a fingerprint of the real data: how far a run's profile is from it."""

import math
from collections.abc import Mapping

from symshrec.reporting.tables.published import published_cells
from symshrec.reporting.tables.results import find_score, source
from symshrec.reporting.tables.typeset import Grid, Text

COLUMNS = ("all", "P0", "P1", "P2", "P3", "P4", "P5", "astroid", "egg_keplero", "lemniscate_bernoulli")


def profile(method: str) -> dict[tuple[str, str], float]:
    """(metric, group) → published value of a method, over Tables 3 and 4."""
    return {key[2:]: value for key, value in published_cells().items() if key[0] in (3, 4) and key[1] == method}


def distance(result: dict, method: str = "M3 (R1)") -> float:
    """Root mean square difference between a run and a method's published Tables 3 and 4, all cells alike.

    Raises:
        ValueError: naming file, metric and group, where the run saw no cloud of a group or lacks a score.
    """
    squares = []
    for (metric, group), value in profile(method).items():
        if (score := find_score(result, metric, group)) is None:
            raise ValueError(f"{source(result)} saw no cloud of group {group}; evaluate the whole split")
        squares.append((score - value) ** 2)
    return math.sqrt(sum(squares) / len(squares))


def fingerprint_grid(results: Mapping[str, tuple[str, dict]], method: str = "M3 (R1)") -> Grid:
    """One row per alternative (name → what it changes, its metrics.json), nearest first, under the published row."""
    published = {**profile(method), ("mAP", "all"): published_cells()[2, method, "mAP", "all"]}
    rows = [["published", "", *(f"{published['mAP', group]:.2f}" for group in COLUMNS), ""]]
    for name, (change, result) in sorted(results.items(), key=lambda item: distance(item[1][1], method)):
        values = [f"{find_score(result, 'mAP', group):.2f}" for group in COLUMNS]
        rows.append([name, change, *values, f"{distance(result, method):.3f}"])
    header = ["alternative", "what it changes", *(f"mAP {group}" for group in COLUMNS), "distance"]
    return Grid(
        f"Distance to the published profile of {method}", header, [[Text(t) for t in row] for row in rows], left=2
    )
