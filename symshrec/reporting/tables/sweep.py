"""§5 The same predictions under many tolerances: mAP over θ at fixed ε, and over ε at fixed θ."""

from collections.abc import Iterator, Sequence
from itertools import product

from symshrec.reporting.tables.results import (
    EPSILON,
    LABELS,
    THETA_DEG,
    TIGHT_EPSILON,
    TIGHT_THETA_DEG,
    find_score,
    tolerances,
)
from symshrec.reporting.tables.typeset import Grid, Text

TABLED = tuple(product((THETA_DEG, TIGHT_THETA_DEG), (EPSILON, TIGHT_EPSILON)))
SWEPT_METRICS = ("mAP", "recall_aware_mAP")


def swept(results: Sequence[dict]) -> list[dict]:
    """The results that hold more pairs of tolerances than the tables show."""
    return [result for result in results if len(tolerances(result)) > len(TABLED)]


def sweep_curves(result: dict, metric: str) -> dict[str, tuple[list[float], list[float | None], float]]:
    """The two curves of one result over the whole split, along the pairs that hold the paper's θ = 1°, ε = 1%.

    Returns:
        "theta": (angles in degrees, scores, the ε held), "epsilon": (shares of the diagonal, scores, the θ held). Where
        the sweep leaves the paper's value out, the nearest one in it is held.
    """
    pairs = tolerances(result)
    held_epsilon = min((epsilon for _, epsilon in pairs), key=lambda epsilon: abs(epsilon - EPSILON))
    held_theta = min((theta for theta, _ in pairs), key=lambda theta: abs(theta - THETA_DEG))
    thetas = [theta for theta, epsilon in pairs if epsilon == held_epsilon]
    epsilons = [epsilon for theta, epsilon in pairs if theta == held_theta]
    over_theta = [find_score(result, metric, "all", theta, held_epsilon) for theta in thetas]
    over_epsilon = [find_score(result, metric, "all", held_theta, epsilon) for epsilon in epsilons]
    return {"theta": (thetas, over_theta, held_epsilon), "epsilon": (epsilons, over_epsilon, held_theta)}


def sweep_rows(results: Sequence[dict]) -> Iterator[tuple]:
    """Every swept score over the whole split: (method, metric, θ in degrees, ε, score)."""
    for result in results:
        for metric in SWEPT_METRICS:
            for theta, epsilon in tolerances(result):
                value = find_score(result, metric, "all", theta, epsilon)
                yield result["name"], metric, theta, epsilon, None if value is None else round(value, 6)


def sweep_grids(results: Sequence[dict]) -> list[Grid]:
    """Each metric over θ and over ε, a row per result; blank where a result was not scored."""
    return [_grid(results, metric, along) for metric in SWEPT_METRICS for along in ("theta", "epsilon")]


def _grid(results: Sequence[dict], metric: str, along: str) -> Grid:
    curves = {result["name"]: sweep_curves(result, metric)[along] for result in results}
    columns = sorted({place for places, _, _ in curves.values() for place in places})
    symbol, scale, unit, held = ("θ", 1, "°", "ε = 1%") if along == "theta" else ("ε", 100, "%", "θ = 1°")
    rows = []
    for name, (places, values, _) in curves.items():
        known = dict(zip(places, values, strict=True))
        shown = [known.get(place) for place in columns]
        rows.append([Text(name), *(Text("" if value is None else f"{value:.3f}") for value in shown)])
    header = ["method", *(f"{symbol} {place * scale:.3g}{unit}" for place in columns)]
    return Grid(f"{LABELS.get(metric, metric)} over {symbol}, at {held} or nearest", header, rows)
