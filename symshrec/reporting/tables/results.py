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
AGAIN = "evaluate that run again"
NUMBER, NONE = (int, float), (type(None),)
FIELDS = {  # of a metrics.json, as far as tables and figures read it; what may be None may be absent
    "name": (str,),
    "scores": (list,),
    "data": (dict,),
    "code": (dict,),
    "weights": (list, *NONE),
    "precision_recall": (list, *NONE),
    "oracle": (bool, *NONE),
    "partial": (bool, *NONE),
}
DATA = {"name": (str,), "split": (str,), "clouds": (int,), "manifest_sha256": (str, *NONE)}
CODE = {"version": (str,), "commit": (str, *NONE)}
PARTS: dict[str, dict[str, tuple]] = {  # what the lists hold
    "scores": {
        **{"metric": (str,), "group": (str,), "theta_deg": NUMBER, "epsilon": NUMBER, "value": NUMBER + NONE},
        **{"clouds": (int, *NONE), "standard_error": NUMBER + NONE},
    },
    "weights": {"name": (str,), "sha256": (str,), "about": (str,)},
    "precision_recall": {"theta_deg": NUMBER, "epsilon": NUMBER, "precision": (list,)},
}
WORDS = {str: "text", list: "a list", dict: "an object", bool: "true or false", int: "a number", type(None): "null"}


def read_result(path: Path) -> dict:
    """A run's metrics.json, with `file` added so that later errors can name it.

    Raises:
        ValueError: naming the file, where it is not JSON, and the field that is missing or of the wrong type.
    """
    path = Path(path)
    try:
        result = json.loads(path.read_text(encoding="utf-8"))
    except (json.JSONDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise ValueError(f"{path} is not a metrics.json: {error}; {AGAIN}") from error
    _check_fields(path, "", result, FIELDS)
    _check_fields(path, "data", result["data"], DATA)
    _check_fields(path, "code", result["code"], CODE)
    for name, fields in PARTS.items():
        for place, part in enumerate(result.get(name) or ()):
            _check_fields(path, f"{name}[{place}]", part, fields)
    return {**result, "file": str(path)}


def _check_fields(path: Path, where: str, node: object, fields: dict[str, tuple]) -> None:
    if not isinstance(node, dict):
        raise ValueError(f"{path}: {where or 'all of it'} is {_shown(node)}, expected an object; {AGAIN}")
    missing = [name for name, kinds in fields.items() if name not in node and type(None) not in kinds]
    if missing:
        raise ValueError(f"{path}{where and f': {where}'} lacks {', '.join(missing)}; {AGAIN}")
    for name, kinds in fields.items():
        value = node.get(name)
        if not isinstance(value, kinds) or (isinstance(value, bool) and bool not in kinds):
            expected = " or ".join(WORDS[kind] for kind in kinds if kind in WORDS)
            field = f"{where}.{name}" if where else name
            raise ValueError(f"{path}: {field} is {_shown(value)}, expected {expected}; {AGAIN}")


def _shown(value: object) -> str:
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 40 else f"{text[:39]}…"


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
    value = score_row(result, metric, group, theta_deg, epsilon)["value"]
    if value is None or math.isnan(value):
        return None
    if not 0 <= value <= 1:
        raise ValueError(f"{source(result)}: metric {metric}, group {group} is {value}, outside [0, 1]")
    return float(value)


def score_row(result: dict, metric: str, group: str, theta_deg: float, epsilon: float) -> dict:
    """The entry of `scores` that holds one score; ValueError where there is none."""
    for score in result["scores"]:
        if score["metric"] == metric and score["group"] == group and _at(score, theta_deg, epsilon):
            return score
    raise ValueError(
        f"{source(result)} has no score for metric {metric}, group {group} at θ = {theta_deg:g}°, "
        f"ε = {epsilon:.4g}; evaluate the whole split at these tolerances"
    )


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
    by_name, by_data = {}, {}
    for result in results:
        if (other := by_name.setdefault(result["name"], result)) is not result:
            raise ValueError(f"{source(other)} and {source(result)} are both named {result['name']!r}; rename one")
        by_data.setdefault(data_key(result), []).append(result)
    if len(by_data) > 1:
        versions = sorted(by_data.values(), key=len, reverse=True)  # of a size, in the order given
        listed = "; ".join(f"{', '.join(map(source, own))} on {describe_data(own[0])}" for own in versions)
        odd = ", ".join(source(each) for own in versions[1:] for each in own)
        raise ValueError(
            f"runs on different data cannot share a table: {listed}; evaluate {odd} again, or the others where these "
            "are the newer ones"
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
    return f"Data: {describe_data(results[0])}. Code: symshrec {', '.join(versions)}.{trained}"


def describe_data(result: dict) -> str:
    """Data, split, clouds and manifest in one phrase."""
    data = result["data"]
    return f"{data['name']} {data['split']}, {data['clouds']:,} clouds, manifest {_short(data.get('manifest_sha256'))}"


def data_key(result: dict) -> tuple:
    """What two runs share that were measured on the same clouds: names, number of clouds and manifest."""
    data = result["data"]
    return data["name"], data["split"], data["clouds"], data.get("manifest_sha256")


def _short(digest: str | None) -> str:
    return digest[:12] if digest else "unknown"
