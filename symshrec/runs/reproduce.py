"""§5 All that the tables of some data are made of: its clouds, every row, the tables. What is there is left alone."""

import hashlib
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from omegaconf import DictConfig

import symshrec
from symshrec.benchmark.generate import generate_dataset
from symshrec.files.atomic import write_atomically
from symshrec.files.pool import kept_processes
from symshrec.runs.config import benchmark_of, conf_folder, load, refined_rows

MADE = "made.json"  # beside the tables: of which bytes they were made, and what was printed
METRICS, PREDICTIONS = "metrics.json", "predictions/predictions.safetensors"  # of a run that has ended
DATA = ("data=", "data@")  # overrides that choose the data


@dataclass(frozen=True)
class Row:
    """A row of a table as a run: its experiment, and the data that it is over, `data` and `config` of its name."""

    experiment: str
    refined: bool
    data: str

    def config(self, overrides: Sequence[str], folders: Sequence[str | PathLike] = ()) -> DictConfig:
        """The run's whole configuration, as `symshrec evaluate` with these words would compose it."""
        more = ["method.refine=true"] if self.refined else []
        return load([*_of_data(overrides, self.data), f"experiment={self.experiment}", *more], folders)


def reproduce(config: DictConfig, overrides: Sequence[str], folders: Sequence[str | PathLike] = ()) -> str:
    """Generate what is missing of the data, run the rows that are missing or out of date, and write the tables.

    One process after the other is spared: all rows run in this one. It can be killed at any moment and goes on where it
    was; where nothing at all has changed since it ended, it ends again before PyTorch is imported.

    Args:
        config: composed of `overrides`: what the command line says, which every row is run with too.
        folders: of configurations of the user's own.

    Returns:
        The tables as text, and what was written.

    Raises:
        ValueError: as `generate_dataset`, `evaluate` and `tabulate`.
    """
    _check(config, overrides)
    for data in data_sets(config):
        own = config if data == config.data.name else load(_of_data(overrides, data), folders)
        generate_dataset(benchmark_of(own), own.data.root, workers=config.workers)
    record = Path(config.paths.tables) / MADE
    if text := _unchanged(record, config, overrides):
        return f"{text}\nnothing has changed since: {config.paths.tables}"
    from symshrec.runs.progress import Progress, jobs_of  # Lightning, which takes seconds to import
    from symshrec.runs.tabulate import tabulate

    with kept_processes(), Progress(jobs_of(rows_of(config), overrides, folders)) as progress:
        progress.run()
    done = tabulate(config)
    text = "\n".join([done.text, *(f"written: {path}" for path in done.files), *done.remarks])
    write_atomically(record, json.dumps({"bytes": _bytes(config, overrides), "text": text}, indent=1).encode())
    return text


def _check(config: DictConfig, overrides: Sequence[str]) -> None:
    """Refuse what names one place for all data, and data that nothing can generate."""
    if config.data.kind.name != "shards" or config.data.variant:
        raise ValueError(
            f"reproduce generates what the paper's tables need, and data={config.data.name}{config.data.variant} is "
            "something else; use generate, evaluate and tables for that"
        )
    of_one = ("data.root=", "folder=", "name=", "title=")
    if wrong := [word for word in overrides if word.startswith(of_one) and "${" not in word]:
        raise ValueError(
            f"{wrong[0]} would be the same for all data and rows; choose paths.data and paths.runs instead"
        )


def data_sets(config: DictConfig) -> list[str]:
    """The data whose rows stand in the tables of `config.data`: itself, that of P6–P9, that of P10–P15."""
    return list(dict.fromkeys([config.data.name, config.data.hard, config.data.scan]))


def rows_of(config: DictConfig) -> list[Row]:
    """Every row to run, in the tables' order; the refined ones and the oracle's with `rows.all`."""
    detecting = [*config.rows.published, *config.rows.ours]
    main, *others = data_sets(config)
    rows = [Row(name, False, main) for name in detecting]
    if config.rows.all:
        rows += [Row(name.removesuffix("_refine"), True, main) for name in refined_rows(config)]
    return [*rows, *(Row(name, False, data) for data in others for name in detecting)]


def _of_data(overrides: Sequence[str], data: str) -> list[str]:
    return [*(word for word in overrides if not word.startswith(DATA)), f"data={data}"]


def _unchanged(record: Path, config: DictConfig, overrides: Sequence[str]) -> str | None:
    """What was printed last time, where not a byte has changed since of all that it was made of; else None."""
    try:
        made = json.loads(record.read_text(encoding="utf-8"))
        return made["text"] if made["bytes"] == _bytes(config, overrides) else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _bytes(config: DictConfig, overrides: Sequence[str]) -> str:
    """sha256 over the command, the package with its weights, the data's manifests, all runs, and the tables."""
    found = hashlib.sha256(repr(list(overrides)).encode())
    for path in _files(config):
        found.update(f"{path} ".encode() + hashlib.sha256(path.read_bytes()).digest())
    return found.hexdigest()


def _files(config: DictConfig) -> Iterator[Path]:
    package = Path(symshrec.__file__).parent
    for folder in (package, conf_folder()):
        yield from sorted(path for path in folder.rglob("*") if path.is_file() and "__pycache__" not in path.parts)
    runs, tables, variant = Path(config.paths.runs), Path(config.paths.tables), config.data.variant
    for data in (*data_sets(config), f"{config.data.name}-so3"):
        name = f"{data}{variant}" if data == config.data.name else data
        yield from Path(config.paths.data).glob(f"{name}/manifest.json")
        for path in sorted((runs / name).rglob(METRICS)):
            yield from (each for each in (path, path.parent / PREDICTIONS) if each.exists())
    yield from sorted(path for path in tables.glob("*") if path.is_file() and path.name != MADE)
