"""Tables 2–4 as the paper prints them, read from the package's published.csv."""

import csv
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from types import MappingProxyType

Key = tuple[int | str, str, str, str]  # table, method, metric, group


@cache
def published_cells() -> Mapping[Key, float]:
    """Every published cell in the paper's order: (table, method, metric, group) → value in [0, 1].

    Methods and metrics are named as in the paper; groups are `all`, P0–P5 and the family names of the benchmark.
    """
    text = files("symshrec.reporting.tables").joinpath("published.csv").read_text(encoding="utf-8")
    rows = csv.DictReader(text.splitlines())
    return MappingProxyType(
        {(int(row["table"]), row["method"], row["metric"], row["group"]): float(row["value"]) for row in rows}
    )


@cache
def published_methods() -> tuple[str, ...]:
    """The seven published runs in the paper's order, M1 (R1) to M3 (R2)."""
    return tuple(dict.fromkeys(method for _, method, _, _ in published_cells()))
