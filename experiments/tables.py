"""§5 Tables 2–4 from finished runs, ours beside the published: `python experiments/tables.py data=quick|paper`."""

import shutil
from pathlib import Path

from omegaconf import DictConfig

from symshrec.configs import entry
from symshrec.reporting.figures import make_result_figures
from symshrec.reporting.results import read_result
from symshrec.reporting.tables import write_tables


@entry
def tables(config: DictConfig) -> None:
    """Read the runs that `tables` names, write results/<data>/, print what was written."""
    data = f"{config.data.name}{config.data.variant}"
    runs, results = Path(config.paths.runs) / data, Path(config.paths.results) / data
    missing = [name for name in config.tables if not (runs / name / "metrics.json").exists()]
    if missing:
        raise ValueError(
            f"no metrics.json in {', '.join(str(runs / name) for name in missing)}; "
            f"python experiments/evaluate.py --multirun sweep=tables data={config.data.name} makes them"
        )
    for name in config.tables:
        kept = results / name
        kept.mkdir(parents=True, exist_ok=True)
        for file in ("config.yaml", "metrics.json"):
            shutil.copyfile(runs / name / file, kept / file)
    finished = [read_result(runs / name / "metrics.json") for name in config.tables]
    written, text = write_tables(finished, results)
    written += make_result_figures(finished, results)
    print(text)
    print("\n".join(f"written: {path}" for path in written))


if __name__ == "__main__":
    tables()
