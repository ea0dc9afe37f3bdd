"""§5 Every table from finished runs, ours beside the published: `python experiments/tables.py data=quick|paper`.

P6–P9 come from the runs on `data.hard`, P10–P15 from those on `data.scan`, full rotations from those on <data>-so3,
where there are any."""

import shutil
from collections.abc import Sequence
from pathlib import Path

from omegaconf import DictConfig

from symshrec.files.predictions import WHOLE
from symshrec.reporting.figures.figures import make_result_figures
from symshrec.reporting.tables.compared import compare_runs
from symshrec.reporting.tables.published_tables import write_tables
from symshrec.reporting.tables.refinement import write_refinement
from symshrec.reporting.tables.results import is_oracle, provenance, read_result
from symshrec.runs.config import entry
from symshrec.runs.evaluate import datamodule_of


@entry
def tables(config: DictConfig) -> None:
    """Read the runs that `tables` names, write results/<data>/, print what was written and what has not run."""
    data = f"{config.data.name}{config.data.variant}"
    runs, results = Path(config.paths.runs) / data, Path(config.paths.results) / data
    main = _finished(config, data, config.tables)
    if not main:
        raise ValueError(
            f"no metrics.json in {', '.join(str(runs / name) for name in config.tables)}; "
            f"python experiments/evaluate.py --multirun sweep=tables data={config.data.name} makes them"
        )
    _finished(config, data, config.cards)  # kept, and in no table
    hard = _finished(config, config.data.hard, config.tables)
    scan = _finished(config, config.data.scan, config.tables)
    so3 = _finished(config, f"{config.data.name}-so3", config.tables_so3)
    finished = list(main.values())
    beside = {name: list(each.values()) for name, each in (("hard", hard), ("scan", scan), ("so3", so3))}
    written, text = write_tables(finished, results, **beside)
    print(text)
    paths = {name: runs / name / "predictions" / WHOLE for name in main}
    compared = compare_runs(paths, datamodule_of(config).split(config.data.test_split))
    refined, text = write_refinement(compared, results, provenance(finished))
    searched = [run for name, run in compared.items() if not is_oracle(main[name])]
    written += refined + make_result_figures(finished, results, searched)
    print(text)
    print("\n".join(f"written: {path}" for path in written))
    if missing := [name for name in config.tables if name not in main]:
        print(f"not run, so left out: {', '.join(missing)}")


def _finished(config: DictConfig, data: str, names: Sequence[str]) -> dict[str, dict]:
    """The results of those runs on some data that have ended, by folder, kept in results/<data>/ too."""
    finished = {}
    for name in names:
        folder, kept = Path(config.paths.runs) / data / name, Path(config.paths.results) / data / name
        if (folder / "metrics.json").exists():
            kept.mkdir(parents=True, exist_ok=True)
            for file in ("config.yaml", "metrics.json"):
                shutil.copyfile(folder / file, kept / file)
            finished[name] = read_result(folder / "metrics.json")
    return finished


if __name__ == "__main__":
    tables()
