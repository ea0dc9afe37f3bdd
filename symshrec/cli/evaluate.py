"""§4–5 `symshrec evaluate method=m3 run=k200 data=paper [--multirun …]`: a method over the test split."""

from pathlib import Path

from omegaconf import DictConfig

from symshrec.runs.command import entry


@entry
def command(config: DictConfig) -> float | None:
    """Detect, score, record; say where, and the figures of Table 2. The objective of a sweep is its mAP."""
    from symshrec.reporting.tables.results import EPSILON, THETA_DEG, tolerances
    from symshrec.runs.evaluate import evaluate

    result = evaluate(config)
    scored = tolerances(result)
    theta_deg, epsilon = (THETA_DEG, EPSILON) if (THETA_DEG, EPSILON) in scored else scored[0]
    figures = {
        score["metric"]: score["value"]
        for score in result["scores"]
        if (score["group"], score["theta_deg"], score["epsilon"]) == ("all", theta_deg, epsilon)
    }
    told = ", ".join(f"{metric} {value:.4f}" for metric, value in figures.items())
    partial = result.get("partial")
    where = f"partial run, nothing stored: {', '.join(partial)}" if partial else Path(config.folder) / "metrics.json"
    print(f"{result['name']}, {result['data']['clouds']} clouds, {theta_deg:g}° and {epsilon:.2%}: {told} ({where})")
    return figures.get("mAP")
