"""§2.1–2.2 (seed, split, index) → a labelled cloud, and all of them → shards: in parallel, resumable, verified."""

import hashlib
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from symshrec.benchmark.balance import generator, split_labels
from symshrec.benchmark.cloud import (
    ALL_FAMILIES,
    HARD_PERTURBATIONS,
    PERTURBATIONS,
    PLANELESS,
    SCAN_PERTURBATIONS,
    LabelledCloud,
    Labels,
)
from symshrec.benchmark.config import BenchmarkConfig, UnitScaling, check_config, differences, plain
from symshrec.benchmark.manifest import (
    GENERATOR_VERSION,
    MANIFEST,
    REQUEST,
    Manifest,
    ShardError,
    ShardRecord,
    damages,
    json_text,
    read_manifest,
    read_request,
)
from symshrec.benchmark.perturbations import PERTURBATIONS as PERTURB
from symshrec.benchmark.planeless import draw_planeless
from symshrec.benchmark.poses import draw_pose
from symshrec.benchmark.scene import Scene
from symshrec.benchmark.shard_file import MappedShard, encode_shard
from symshrec.benchmark.shards import cloud_name
from symshrec.benchmark.surfaces import Moved, draw_shape
from symshrec.files.atomic import remove_temporaries, require_room, sole_writer, write_atomically
from symshrec.files.foreign import parse_json
from symshrec.files.pool import ProcessPool, WorkerDiedError

SHAPE, POSE, PERTURBATION = range(3)  # a stream each: another pose or noise leaves the shape as it is
PROBED_CLOUDS = 42


def generate_cloud(config: BenchmarkConfig, split: str, index: int) -> LabelledCloud:
    """Cloud `index` of a split: curve → surface → pose → perturbation. Depends on (seed, split, index) alone.

    Raises:
        ValueError: for a split the config lacks. IndexError: for an index outside the split.
    """
    labels = split_labels(config, split)
    if not 0 <= index < len(labels):
        raise IndexError(f"cloud {index} of split {split!r}, which has {len(labels)} clouds")
    family, perturbation = ALL_FAMILIES[labels.families[index]], PERTURBATIONS[labels.perturbations[index]]
    noise = generator(config.seed, split, index, PERTURBATION)
    draw = draw_planeless if family == PLANELESS else partial(draw_shape, family)
    shape = draw(generator(config.seed, split, index, SHAPE), config)
    pose = draw_pose(generator(config.seed, split, index, POSE), config.pose)
    points, planes, scaling = shape.surface.points(shape.chart), shape.planes, config.surface.unit_scaling
    if scaling is UnitScaling.after_noise:
        scene = Scene(points, planes, shape.surface, shape.chart)
        points, drawn, planes = PERTURB[perturbation](scene, noise, config.noise)
    factor = 1.0 if scaling is UnitScaling.never else shape.unit_factor
    points[:, :2] *= factor
    points, planes = pose(points), planes.transformed(pose.rotation, pose.translation)
    if scaling is not UnitScaling.after_noise:
        surface = Moved(shape.surface, pose.rotation * [factor, factor, 1.0], pose.translation)
        scene = Scene(points, planes, surface, shape.chart)
        points, drawn, planes = PERTURB[perturbation](scene, noise, config.noise)
    made = Labels(family, shape.solid, perturbation, shape.parameters | drawn, pose.rotation, pose.translation)
    return LabelledCloud(points.astype(np.float32), planes, made, index, cloud_name(split, index))


def generate_dataset(config: BenchmarkConfig, root: str | Path, workers: int = 1, progress: bool = True) -> Manifest:
    """Every cloud of every split into shards under `root`; the manifest is written last.

    Killed and called again, it keeps the finished shards and completes the rest, to the same bytes. On a finished
    folder it verifies every shard and makes anew only those missing, truncated or altered.

    Args:
        workers: processes; 1 stays in this one.
        progress: show a bar with the rate and the time left, where stderr is a terminal.

    Raises:
        ValueError: for a config that cannot be.
        ShardError: where the folder holds another config's shards, naming each differing value.
        FolderInUseError: where another process writes there.
        DiskFullError: where the shards do not fit.
    """
    check_config(config)
    for split in config.splits:
        split_labels(config, split)
    root = Path(root)
    with sole_writer(root):
        remove_temporaries(root)
        request: dict[str, Any] = {"generator_version": GENERATOR_VERSION, "config": _influential(config)}
        manifest = read_manifest(root) if (root / MANIFEST).exists() else None
        tasks = _tasks(config)
        _refuse_other(root, request, manifest, tasks)
        kept = _kept(root, tasks, manifest)
        missing = [task for task in tasks if task.file not in kept]
        require_room(root, _estimate(config, missing))
        if manifest is None:
            write_atomically(root / REQUEST, json_text(request).encode())
        kept |= _make(config, root, missing, manifest, workers, progress)
        if manifest is None:
            manifest = Manifest.summarise(request["config"], [kept[task.file] for task in tasks])
            write_atomically(root / MANIFEST, manifest.to_json().encode())
        for path in (root / REQUEST, *(root / _sidecar(task.file) for task in tasks)):
            path.unlink(missing_ok=True)
    return manifest


def _influential(config: BenchmarkConfig) -> dict:
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


@dataclass(frozen=True)
class _Task:
    """The clouds first … first + clouds − 1 of a split, to be one file."""

    file: str
    split: str
    first: int
    clouds: int


def _tasks(config: BenchmarkConfig) -> list[_Task]:
    size = config.clouds_per_shard
    return [
        _Task(f"{split}-{first // size:05d}.safetensors", split, first, min(size, each.clouds - first))
        for split, each in config.splits.items()
        for first in range(0, each.clouds, size)
    ]


def _sidecar(file: str) -> str:
    return Path(file).with_suffix(".json").name


def _refuse_other(root: Path, request: dict, manifest: Manifest | None, tasks: list[_Task]) -> None:
    """Refuse a folder that was begun with another config or generator version, or that holds others' shards."""
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


def _kept(root: Path, tasks: list[_Task], manifest: Manifest | None) -> dict[str, ShardRecord]:
    """Records of the shards that are whole: by the manifest, or by their sidecars while there is none."""
    records = manifest.shards if manifest else [each for each in map(lambda t: _recorded(root, t), tasks) if each]
    found = damages(root, records)
    return {record.file: record for record, what in zip(records, found, strict=True) if what is None}


def _recorded(root: Path, task: _Task) -> ShardRecord | None:
    """The sidecar's record of a shard, None where there is no valid one."""
    try:
        record = ShardRecord(**parse_json((root / _sidecar(task.file)).read_bytes()))
        if (record.file, record.split, record.first, record.clouds) != tuple(asdict(task).values()):
            return None
        MappedShard(root / record.file, record)  # the manifest will repeat the record's counts: they must be right
    except (OSError, ValueError, TypeError):
        return None
    return record


def _estimate(config: BenchmarkConfig, tasks: list[_Task]) -> int:
    """Bytes that the tasks' shards will take, from a few clouds of each split."""
    total = 0.0
    for split in {task.split for task in tasks}:
        clouds = [
            generate_cloud(config, split, index) for index in range(min(PROBED_CLOUDS, config.splits[split].clouds))
        ]
        total += len(encode_shard(clouds, split)) / len(clouds) * sum(t.clouds for t in tasks if t.split == split)
    return round(total)


def _make(config, root, missing: list[_Task], manifest, workers: int, progress: bool) -> dict[str, ShardRecord]:
    """Write the missing shards, showing how far they are; their records by file."""
    expected = {each.file: each.sha256 for each in manifest.shards} if manifest else {}
    total = sum(each.clouds for each in config.splits.values())
    done = total - sum(task.clouds for task in missing)
    made = {}
    with tqdm(total=total, initial=done, unit=" clouds", desc=root.name, disable=None if progress else True) as bar:
        for record in _produce(config, root, missing, expected, workers):
            made[record.file] = record
            bar.update(record.clouds)
    return made


def _produce(config, root, tasks: list[_Task], expected: dict[str, str], workers: int) -> Iterator[ShardRecord]:
    """Write the tasks' shards and give their records as they are finished."""
    jobs = [(task, expected.get(task.file)) for task in tasks]
    with ProcessPool(min(workers, len(tasks)), config, root) as pool:
        try:
            yield from pool.results(_write_shard, jobs, in_order=False)
        except WorkerDiedError as error:
            raise RuntimeError(
                f"{error}; run the same command again, with fewer workers or smaller shards; finished shards are kept"
            ) from error


def _write_shard(config: BenchmarkConfig, root: Path, task: _Task, expected: str | None) -> ShardRecord:
    """Generate and write one shard, then its sidecar; with an expected sha256 the manifest already records it."""
    clouds = [generate_cloud(config, task.split, index) for index in range(task.first, task.first + task.clouds)]
    data = encode_shard(clouds, task.split)
    sha256 = hashlib.sha256(data).hexdigest()
    if expected is not None and sha256 != expected:
        raise ShardError(
            f"{root / task.file} cannot be made anew as the manifest records it: the code, NumPy or the processor is "
            "another than at first; generate the whole benchmark into another folder"
        )
    record = ShardRecord(
        **asdict(task),
        points=sum(len(cloud.points) for cloud in clouds),
        max_planes=max(len(cloud.truth) for cloud in clouds),
        families=dict(Counter(cloud.labels.family for cloud in clouds)),
        solids=dict(Counter(cloud.labels.solid for cloud in clouds)),
        perturbations=dict(Counter(cloud.labels.perturbation for cloud in clouds)),
        bytes=len(data),
        sha256=sha256,
    )
    write_atomically(root / task.file, data)
    if expected is None:
        write_atomically(root / _sidecar(task.file), json_text(asdict(record)).encode())
    return record
