"""§5 What one run measured: its metrics.json, and the single scores in it."""

import json
import math
from collections.abc import Sequence
from pathlib import Path

from symshrec.metrics import METRICS

THETA_DEG, EPSILON = 1.0, 0.01  # the tolerances of Tables 2–4
TIGHT_THETA_DEG, TIGHT_EPSILON = 0.1, 0.001  # of our table ten times tighter
PUBLISHED_METRICS, HIDDEN_METRICS = METRICS[:2], METRICS[2:]
LABELS = {"recall_aware_mAP": "recall-aware mAP", "count_accuracy": "count accuracy"}  # else the metric's own name
NEEDED = ("name", "scores", "data", "code")


def read_result(path: Path) -> dict:
    """A run's metrics.json, with `file` added so that later errors can name it.

    Raises:
        ValueError: naming the file, where it is not JSON or lacks one of name, scores, data and code.
    """
    path = Path(path)
    try:
        result = json.loads(path.read_text(encoding="utf-8"))
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f"{path} is not a metrics.json: {error}; run the evaluation again") from error
    missing = [name for name in NEEDED if not isinstance(result, dict) or name not in result]
    if missing:
        raise ValueError(f"{path} lacks {', '.join(missing)}; run the evaluation again")
    return {**result, "file": str(path)}


def source(result: dict) -> str:
    """The result's file for messages, or its row name where it was made in memory."""
    return result.get("file", f"the result {result['name']!r}")


def is_oracle(result: dict) -> bool:
    """Whether the run was told the true planes, so that it shows a limit and is no method to compare."""
    return bool(result.get("oracle"))


def tolerances(result: dict) -> list[tuple[float, float]]:
    """The pairs (θ in degrees, ε as a share of the diagonal) that the result was scored at, ascending."""
    return sorted({(float(score["theta_deg"]), float(score["epsilon"])) for score in result["scores"]})


def scored_at(result: dict, theta_deg: float, epsilon: float) -> bool:
    """Whether the result was scored at this pair of tolerances."""
    return any(_at(score, theta_deg, epsilon) for score in result["scores"])


def find_score(
    result: dict, metric: str, group: str, theta_deg: float = THETA_DEG, epsilon: float = EPSILON
) -> float | None:
    """One score; None where the run saw no cloud of the group.

    Raises:
        ValueError: naming file, metric and group, where the score is absent or outside [0, 1].
    """
    for score in result["scores"]:
        if score["metric"] == metric and score["group"] == group and _at(score, theta_deg, epsilon):
            break
    else:
        raise ValueError(
            f"{source(result)} has no score for metric {metric}, group {group} at θ = {theta_deg:g}°, "
            f"ε = {epsilon:.4g}; evaluate the whole split at these tolerances"
        )
    value = score["value"]
    if value is None or math.isnan(value):
        return None
    if not 0 <= value <= 1:
        raise ValueError(f"{source(result)}: metric {metric}, group {group} is {value}, outside [0, 1]")
    return float(value)


def _at(score: dict, theta_deg: float, epsilon: float) -> bool:
    return math.isclose(score["theta_deg"], theta_deg, rel_tol=1e-6) and math.isclose(
        score["epsilon"], epsilon, rel_tol=1e-6
    )


def check_comparable(results: Sequence[dict]) -> None:
    """Let only results of differently named rows on the same data into one table.

    Raises:
        ValueError: for no result at all, for two of one name, or for two on different data; naming the files.
    """
    if not results:
        raise ValueError("no results to tabulate; evaluate at least one method first")
    by_name = {}
    for result in results:
        if (other := by_name.setdefault(result["name"], result)) is not result:
            raise ValueError(f"{source(other)} and {source(result)} are both named {result['name']!r}; rename one")
        if _data_key(result) != _data_key(results[0]):
            raise ValueError(
                f"{source(results[0])} and {source(result)} were measured on different data "
                f"({_describe(results[0])} against {_describe(result)}); tabulate them apart"
            )


def provenance(results: Sequence[dict]) -> str:
    """One line on where the numbers come from: data, clouds, manifest, code and trained weights."""
    versions = dict.fromkeys(f"{each['code']['version']} at {_short(each['code'].get('commit'))}" for each in results)
    weights = dict.fromkeys(
        f"{Path(used['name']).stem} ({_short(used['sha256'])}: {used['about']})"
        for each in results
        for used in each.get("weights") or ()
    )
    trained = f" Weights: {'; '.join(weights)}." if weights else ""
    return f"Data: {_describe(results[0])}. Code: symshrec {', '.join(versions)}.{trained}"


def _describe(result: dict) -> str:
    data = result["data"]
    return f"{data['name']} {data['split']}, {data['clouds']:,} clouds, manifest {_short(data.get('manifest_sha256'))}"


def _data_key(result: dict) -> tuple:
    data = result["data"]
    return data["name"], data["split"], data["clouds"], data.get("manifest_sha256")


def _short(digest: str | None) -> str:
    return digest[:12] if digest else "unknown"
