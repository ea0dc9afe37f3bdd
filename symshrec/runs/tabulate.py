"""§5 All tables and figures of the runs on some data, under runs/, and the command that publishes them in results/."""

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from omegaconf import DictConfig

from symshrec.benchmark.cloud import PUBLISHED_PERTURBATIONS
from symshrec.files.atomic import write_atomically
from symshrec.files.predictions import WHOLE
from symshrec.reporting.figures.figures import make_result_figures
from symshrec.reporting.tables.compared import compare_runs
from symshrec.reporting.tables.published_tables import write_tables
from symshrec.reporting.tables.refinement import write_refinement
from symshrec.reporting.tables.results import is_oracle, provenance
from symshrec.reporting.tables.rows import METRICS_FILE, Rows, find_rows
from symshrec.runs.config import refined_rows, so3_rows, table_rows
from symshrec.runs.evaluate import datamodule_of
from symshrec.runs.stores import PREDICTIONS, lacking

RECORD = "rows.json"  # beside the tables: the runs they were made of
PUBLISHED = ("config.yaml", METRICS_FILE)  # of each run


@dataclass(frozen=True)
class Tabulated:
    """files: written. text: the tables, to print. remarks: one line for each run that is in no table."""

    files: list[Path]
    text: str
    remarks: list[str]


def tabulate(config: DictConfig) -> Tabulated:
    """Write the tables and figures of all finished runs on `config.data` into `config.paths.tables`.

    P6–P9 come from the runs on `data.hard`, P10–P15 from those on `data.scan`, full rotations from those on <data>-so3,
    where there are any. The reliability figure and the refinement's table need the predictions themselves: with
    `rows.by_metrics` a run that has none left, from another machine say, is in neither, and a remark names it.

    Raises:
        ValueError: where nothing has run yet, naming the command; for data that lack one of P0–P5; for runs on another
            version of the data, for a damaged metrics.json, and for runs whose predictions are gone, naming the runs.
    """
    data, folder = _name(config), Path(config.paths.tables)
    split = datamodule_of(config).split(config.data.test_split)
    every = _rows(config, data, table_rows(config), split.fingerprint)
    predicted = _with_predictions(every, () if config.rows.by_metrics else table_rows(config))
    main = every if config.rows.by_metrics else predicted
    if not main.results:
        raise ValueError(
            f"no finished run in {main.folder}; symshrec reproduce data={config.data.name} makes them all, and "
            f"symshrec evaluate --multirun sweep=tables data={config.data.name} those on these data alone"
        )
    _check_groups(config.data.name, main)
    hard = _rows(config, config.data.hard, table_rows(config))
    scan = _rows(config, config.data.scan, table_rows(config))
    so3 = _rows(config, f"{config.data.name}-so3", so3_rows(config))
    apart = {"main": main, "hard": hard, "scan": scan, "so3": so3}
    results = list(main.results.values())
    files, text = write_tables(
        results,
        folder,
        hard=list(hard.results.values()),
        scan=list(scan.results.values()),
        so3=list(so3.results.values()),
        missing={name: rows.missing for name, rows in apart.items()},
    )
    paths = {name: main.folder / name / PREDICTIONS / WHOLE for name in predicted.results}
    compared = compare_runs(paths, split)
    compared = {name: replace(each, name=main.results[name]["name"]) for name, each in compared.items()}
    refined, refinement = write_refinement(compared, folder, provenance(results))
    searched = [each for name, each in compared.items() if not is_oracle(main.results[name])]
    files += refined + make_result_figures(results, folder, searched)
    _record(folder, files, list(apart.values()))
    remarks = [f"left out: {line}" for rows in apart.values() for line in rows.left_out]
    if config.rows.by_metrics:
        without = [name for name in main.results if name not in predicted.results]
        if without:
            remarks.append(f"without predictions, so neither in reliability.png nor refinement.*: {', '.join(without)}")
    if main.missing:
        remarks.append(f"not run, so left out: {', '.join(main.missing)}")
    if not config.rows.all and not main.results.keys() & set(refined_rows(config)):
        remarks.append(
            f"the refined rows and the oracle's come with symshrec reproduce data={config.data.name} rows.all=true "
            "(make tables ALL=1)"
        )
    return Tabulated(files, "\n".join(filter(None, (text, refinement))), remarks)


def publish(config: DictConfig) -> list[Path]:
    """Copy the tables and figures of `config.data`, and config.yaml and metrics.json of each row, into results/<data>/.

    Of the runs in `rows.cards`, which are in no table, those that have ended are copied too.

    Returns:
        The files written.

    Raises:
        ValueError: where there are no tables, or a run was evaluated anew since they were made; nothing is copied then.
    """
    runs, results, tables = Path(config.paths.runs), Path(config.paths.results), Path(config.paths.tables)
    data, again = _name(config), f"make them with symshrec tables data={config.data.name}"
    try:
        record = json.loads((tables / RECORD).read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise ValueError(f"no tables to publish in {tables}; {again}") from error
    changed = [run for run, sha256 in record["runs"].items() if _sha256(runs / run / METRICS_FILE) != sha256]
    changed += [str(tables / name) for name in record["files"] if not (tables / name).exists()]
    if changed:
        raise ValueError(f"changed since the tables in {tables} were made: {', '.join(changed)}; {again}")
    cards = (f"{data}/{name}" for name in config.rows.cards)
    published = [*record["runs"], *(run for run in cards if (runs / run / METRICS_FILE).exists())]
    copies = {results / data / name: tables / name for name in record["files"]}
    copies |= {results / run / name: runs / run / name for run in published for name in PUBLISHED}
    for target, source in copies.items():
        target.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(target, source.read_bytes())
    return list(copies)


def _name(config: DictConfig) -> str:
    return f"{config.data.name}{config.data.variant}"


def _rows(config: DictConfig, data: str, listed: Sequence[str], manifest: str | None = None) -> Rows:
    optional = () if config.rows.all else refined_rows(config)
    return find_rows(Path(config.paths.runs) / data, listed, config.rows.cards, manifest, optional)


def _check_groups(data: str, rows: Rows) -> None:
    """Refuse data that the paper's tables cannot be of."""
    groups = {score["group"] for result in rows.results.values() for score in result["scores"]}
    if absent := [name for name in PUBLISHED_PERTURBATIONS if name not in groups]:
        raise ValueError(
            f"the paper's tables need P0–P5, and data={data} has no {', '.join(absent)}. Runs on P6–P9 and P10–P15 "
            "stand in table_hard and table_scan, which symshrec tables data=quick or data=paper makes; every run's "
            f"scores are in {rows.folder / '<run>' / METRICS_FILE}"
        )


def _with_predictions(rows: Rows, listed: Sequence[str]) -> Rows:
    """The rows whose predictions are there and whole.

    Raises:
        ValueError: naming the listed ones that are not among them.
    """
    lacks = {}
    for name, result in rows.results.items():
        if lack := lacking(rows.folder / name, result.get("key"), result["data"]["clouds"]):
            lacks[name] = lack
    if gone := [lack for name, lack in lacks.items() if name in listed]:
        raise ValueError(
            f"{'; '.join(gone)}; evaluate {', '.join(name for name in lacks if name in listed)} again, which predicts "
            "the missing clouds only, or set rows.by_metrics=true, which leaves out what needs predictions"
        )
    kept = {name: result for name, result in rows.results.items() if name not in lacks}
    left_out = [f"{lack}; evaluate {name} again" for name, lack in lacks.items()]
    return replace(rows, results=kept, left_out=rows.left_out + left_out)


def _record(folder: Path, files: Sequence[Path], apart: Sequence[Rows]) -> None:
    runs = {
        f"{rows.folder.name}/{name}": _sha256(rows.folder / name / METRICS_FILE)
        for rows in apart
        for name in rows.results
    }
    record = {"runs": runs, "files": [path.relative_to(folder).as_posix() for path in files]}
    write_atomically(folder / RECORD, (json.dumps(record, indent=1) + "\n").encode())


def _sha256(path: Path) -> str | None:
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else None
