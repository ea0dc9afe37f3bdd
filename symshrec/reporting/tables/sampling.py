"""§5 How far chance moves an mAP at the size of the data: one sentence below a table, from stored rows alone."""

import math
from collections.abc import Sequence

from symshrec.reporting.tables.layouts import ALL, Layout
from symshrec.reporting.tables.results import is_oracle, score_row

METRIC = "mAP"


def sampling_error(result: dict, group: str, theta_deg: float, epsilon: float) -> tuple[float, int] | None:
    """The standard error of one mAP and its number of clouds; None where the run saw no cloud of the group.

    Rows of runs that stored none have its upper bound √(p (1 − p) / n), which a cloud's average precision in [0, 1]
    cannot exceed.
    """
    row = score_row(result, METRIC, group, theta_deg, epsilon)
    if row["value"] is None or not row.get("clouds"):
        return None
    error = row.get("standard_error")
    if error is None:
        error = math.sqrt(max(row["value"] * (1 - row["value"]), 0.0) / row["clouds"])
    return error, row["clouds"]


def sampling_note(results: Sequence[dict], layouts: Sequence[Layout]) -> str:
    """The largest standard error among the rows, over all clouds and in a single column; empty where none is known."""
    found = {}
    for layout in layouts:
        for group in layout.groups:
            errors = (
                sampling_error(each, group, layout.theta_deg, layout.epsilon) for each in results if not is_oracle(each)
            )
            if known := [each for each in errors if each]:
                found[group] = max(known)
    whole = [found.pop(group) for group in ALL if group in found]
    parts = [f"{error:.3f} over all {clouds:,} clouds" for error, clouds in whole]
    if found:
        error, clouds = max(found.values())
        parts.append(f"{error:.3f} in a column ({clouds:,} clouds)")
    if not parts:
        return ""
    return f"With other clouds of the same kind an {METRIC} would differ by chance: one standard error is at most " + (
        f"{' and '.join(parts)}."
    )
