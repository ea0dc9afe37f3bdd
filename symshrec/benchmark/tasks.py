"""The files that a benchmark consists of, which part of them a job makes, and which of them are there and whole."""

import hashlib
import re
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from symshrec.benchmark.cloud import HARD_PERTURBATIONS, PLANELESS, SCAN_PERTURBATIONS
from symshrec.benchmark.config import BenchmarkConfig, differences, plain
from symshrec.benchmark.manifest import (
    GENERATOR_VERSION,
    REQUEST,
    Manifest,
    ShardError,
    ShardRecord,
    damages,
    json_text,
    read_request,
)
from symshrec.benchmark.shard_file import MappedShard
from symshrec.files.foreign import parse_json

ALL = "all"


@dataclass(frozen=True)
class Task:
    """The clouds first … first + clouds − 1 of a split, to be one file."""

    file: str
    split: str
    first: int
    clouds: int


@dataclass(frozen=True)
class Part:
    """Every `parts`-th file of a benchmark, from the `number`-th on: what one of so many jobs makes.

    Raises:
        ValueError: for a part that there is not.
    """

    number: int
    parts: int

    def __post_init__(self):
        if not 1 <= self.number <= self.parts:
            raise ValueError(_wrong(f"{self.number}/{self.parts}"))

    def of(self, tasks: list[Task]) -> list[Task]:
        """This part's tasks; none where there are fewer files than parts."""
        return tasks[self.number - 1 :: self.parts]


def parse_part(text: str) -> Part | None:
    """`K/N` as the Part that it names; None for `all`.

    Raises:
        ValueError: for anything else.
    """
    if text == ALL:
        return None
    if not re.fullmatch(r"[0-9]{1,9}/[0-9]{1,9}", text):
        raise ValueError(_wrong(text))
    number, parts = map(int, text.split("/"))
    return Part(number, parts)


def _wrong(text: str) -> str:
    return f"part is {text}; it must be K/N with K from 1 to N, such as 2/8, or {ALL}"


def tasks_of(config: BenchmarkConfig) -> list[Task]:
    """All files of a benchmark, in the manifest's order."""
    size = config.clouds_per_shard
    return [
        Task(f"{split}-{first // size:05d}.safetensors", split, first, min(size, each.clouds - first))
        for split, each in config.splits.items()
        for first in range(0, each.clouds, size)
    ]


def influential(config: BenchmarkConfig) -> dict:
    """The plain config without the settings of P6–P15 and planeless shapes where no split has them."""
    chosen = plain(config)
    counts = [each for split in config.splits.values() for each in (split.perturbations, split.families) if each]
    named = {name for each in counts for name, count in each.items() if count}
    if named.isdisjoint(HARD_PERTURBATIONS):
        del chosen["noise"]["hard"]
    if named.isdisjoint(SCAN_PERTURBATIONS):
        del chosen["noise"]["scan"]
    if PLANELESS not in named:
        del chosen["planeless"]
    return chosen


def request_of(config: BenchmarkConfig) -> dict[str, Any]:
    """All that decides the bytes of a folder of shards."""
    return {"generator_version": GENERATOR_VERSION, "config": influential(config)}


def refuse_other(root: Path, request: dict, manifest: Manifest | None, tasks: list[Task]) -> None:
    """Refuse a folder that was begun with another config or generator version, or that holds others' shards.

    Raises:
        ShardError: naming each value that differs, and the strange shards.
    """
    begun = request
    if manifest is not None:
        begun = {"generator_version": manifest.generator_version, "config": manifest.config}
    elif (root / REQUEST).exists():
        begun = read_request(root)
    lines = differences(begun["config"], request["config"])
    if begun["generator_version"] != GENERATOR_VERSION:
        lines.append(f"generator version: folder has {begun['generator_version']}, this is {GENERATOR_VERSION}")
    strays = {path.name for path in root.glob("*.safetensors")} - {task.file for task in tasks}
    lines += [f"{name} is no shard of the configuration asked for" for name in sorted(strays)[:5]]
    if lines:
        raise ShardError("\n  ".join([f"{root} holds other shards; choose another folder or empty this one:", *lines]))


def sidecar(file: str) -> str:
    """Name of the file that keeps a shard's record until the manifest does."""
    return Path(file).with_suffix(".json").name


def sidecar_text(record: ShardRecord, request: dict) -> str:
    """What stands there: the record, and the sha256 of the request that the shard was made for."""
    return json_text({**asdict(record), "request": _digest(request)})


def kept(root: Path, tasks: list[Task], request: dict, manifest: Manifest | None) -> dict[str, ShardRecord]:
    """Records of those tasks' shards that are whole: by the manifest, or by their sidecars while there is none."""
    if manifest:
        files = {task.file for task in tasks}
        records = [each for each in manifest.shards if each.file in files]
    else:
        digest = _digest(request)
        records = [each for each in (_recorded(root, task, digest) for task in tasks) if each]
    found = damages(root, records)
    return {record.file: record for record, what in zip(records, found, strict=True) if what is None}


def _recorded(root: Path, task: Task, request: str) -> ShardRecord | None:
    """The sidecar's record of a shard, None where there is no valid one, or one of another request's: jobs that begin
    a folder at once, each with a configuration of its own, cannot see each other on every file system."""
    try:
        content = parse_json((root / sidecar(task.file)).read_bytes())
        if content.pop("request") != request:
            return None
        record = ShardRecord(**content)
        if (record.file, record.split, record.first, record.clouds) != tuple(asdict(task).values()):
            return None
        MappedShard(root / record.file, record)  # the manifest will repeat the record's counts: they must be right
    except (OSError, ValueError, TypeError, KeyError, AttributeError):
        return None
    return record


def _digest(request: dict) -> str:
    return hashlib.sha256(json_text(request).encode()).hexdigest()
