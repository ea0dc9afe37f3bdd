"""§4–5 A method over the test split: `python experiments/evaluate.py method=m3 run=k200 data=paper [--multirun …]`."""

from pathlib import Path

from omegaconf import DictConfig

from symshrec.reporting.tables.results import EPSILON, THETA_DEG, tolerances
from symshrec.runs.config import entry
from symshrec.runs.evaluate import evaluate


@entry
def main(config: DictConfig) -> None:
    """Detect, score, record; say where, and the figures of Table 2."""
    result = evaluate(config)
    scored = tolerances(result)
    theta_deg, epsilon = (THETA_DEG, EPSILON) if (THETA_DEG, EPSILON) in scored else scored[0]
    figures = ", ".join(
        f"{score['metric']} {score['value']:.4f}"
        for score in result["scores"]
        if (score["group"], score["theta_deg"], score["epsilon"]) == ("all", theta_deg, epsilon)
    )
    where = Path(config.folder) / "metrics.json"
    print(f"{result['name']}, {result['data']['clouds']} clouds, {theta_deg:g}° and {epsilon:.2%}: {figures} ({where})")


if __name__ == "__main__":
    main()
