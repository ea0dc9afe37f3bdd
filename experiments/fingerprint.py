"""Which silent choices fit M3's published profile: `python experiments/fingerprint.py --multirun
'fingerprint=glob(*)' method.workers=2`; every job leaves results/fingerprint.md up to date."""

from pathlib import Path

from omegaconf import DictConfig

from symshrec.benchmark.generate import generate_dataset
from symshrec.reporting.tables.fingerprint import fingerprint_grid
from symshrec.reporting.tables.results import read_result
from symshrec.reporting.tables.typeset import markdown
from symshrec.runs.command import entry
from symshrec.runs.config import benchmark_of, conf_folder, load
from symshrec.runs.evaluate import evaluate


@entry
def fingerprint(config: DictConfig) -> None:
    """Generate the alternative's clouds, run the method on them, and rank all alternatives that have run."""
    generate_dataset(benchmark_of(config), config.data.root, workers=config.workers)
    evaluate(config)
    finished = {}
    for delta in sorted((conf_folder() / "fingerprint").glob("*.yaml")):
        other = load([f"fingerprint={delta.stem}"])
        path = Path(config.paths.runs) / f"{other.data.name}{other.data.variant}" / other.name / "metrics.json"
        if path.exists():
            finished[other.name] = (other.title, read_result(path))
    results = Path(config.paths.results)
    results.mkdir(exist_ok=True)
    text = markdown(fingerprint_grid(finished))
    (results / "fingerprint.md").write_text(text + "\n")
    print(text)


if __name__ == "__main__":
    fingerprint()
