"""§2.1–2.2 (seed, split, index) → a labelled cloud, and all of them → shards: in parallel, resumable, verified."""

import hashlib
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path

import numpy as np
from tqdm import tqdm

from symshrec.benchmark.balance import SplitLabels, split_labels
from symshrec.benchmark.cloud import ALL_FAMILIES, PERTURBATIONS, PLANELESS, LabelledCloud, Labels
from symshrec.benchmark.config import BenchmarkConfig, UnitScaling, check_config
from symshrec.benchmark.manifest import MANIFEST, REQUEST, Manifest, ShardError, ShardRecord, json_text, read_manifest
from symshrec.benchmark.perturbations import PERTURBATIONS as PERTURB
from symshrec.benchmark.planeless import draw_planeless
from symshrec.benchmark.poses import draw_pose
from symshrec.benchmark.randomness import generator, generators
from symshrec.benchmark.scene import Scene
from symshrec.benchmark.shard_file import encode_shard
from symshrec.benchmark.shards import cloud_name
from symshrec.benchmark.surfaces import Moved, draw_shape
from symshrec.benchmark.tasks import Part, Task, kept, refuse_other, request_of, sidecar, sidecar_text, tasks_of
from symshrec.files.atomic import (
    atomic_writer,
    joint_writer,
    remove_temporaries,
    require_room,
    sole_writer,
    write_atomically,
)
from symshrec.files.pool import ProcessPool, WorkerDiedError

STREAMS = SHAPE, POSE, PERTURBATION = range(3)  # a stream each: another pose or noise leaves the shape as it is
PROBED_CLOUDS = 42


def generate_cloud(config: BenchmarkConfig, split: str, index: int) -> LabelledCloud:
    """Cloud `index` of a split: curve → surface → pose → perturbation. Depends on (seed, split, index) alone.

    Raises:
        ValueError: for a split the config lacks. IndexError: for an index outside the split.
    """
    labels = _labels(config, split, [index])
    return _cloud(config, split, index, labels, *(generator(config.seed, split, index, stream) for stream in STREAMS))


def generate_clouds(config: BenchmarkConfig, split: str, indices: Sequence[int]) -> Iterator[LabelledCloud]:
    """The clouds of a split at these indices, one after the other: what `generate_cloud` gives for each, in less time.

    Raises:
        ValueError, IndexError: as `generate_cloud`.
    """
    labels = _labels(config, split, indices)
    streams = generators(config.seed, split, np.array([(index, stream) for index in indices for stream in STREAMS]))
    for index, *of_cloud in zip(indices, streams, streams, streams, strict=True):
        yield _cloud(config, split, index, labels, *of_cloud)


def _labels(config: BenchmarkConfig, split: str, indices: Sequence[int]) -> SplitLabels:
    """The split's labels, where it has clouds at these indices."""
    labels = split_labels(config, split)
    for index in indices:
        if not 0 <= index < len(labels):
            raise IndexError(f"cloud {index} of split {split!r}, which has {len(labels)} clouds")
    return labels


def _cloud(
    config: BenchmarkConfig,
    split: str,
    index: int,
    labels: SplitLabels,
    of_shape: np.random.Generator,
    of_pose: np.random.Generator,
    noise: np.random.Generator,
) -> LabelledCloud:
    family, perturbation = ALL_FAMILIES[labels.families[index]], PERTURBATIONS[labels.perturbations[index]]
    draw = draw_planeless if family == PLANELESS else partial(draw_shape, family)
    shape = draw(of_shape, config)
    pose = draw_pose(of_pose, config.pose)
    points, planes, scaling = shape.points, shape.planes, config.surface.unit_scaling
    if scaling is UnitScaling.after_noise:
        scene = Scene(points, planes, shape.surface, shape.chart)
        points, drawn, planes = PERTURB[perturbation](scene, noise, config.noise)
    factor = 1.0 if scaling is UnitScaling.never else shape.unit_factor
    for coordinate in points.T[:2]:
        coordinate *= factor
    points, planes = pose(points), planes.transformed(pose.rotation, pose.translation)
    if scaling is not UnitScaling.after_noise:
        surface = Moved(shape.surface, pose.rotation * [factor, factor, 1.0], pose.translation)
        scene = Scene(points, planes, surface, shape.chart)
        points, drawn, planes = PERTURB[perturbation](scene, noise, config.noise)
    made = Labels(family, shape.solid, perturbation, shape.parameters | drawn, pose.rotation, pose.translation)
    return LabelledCloud(points.astype(np.float32), planes, made, index, cloud_name(split, index))


def generate_dataset(config: BenchmarkConfig, root: str | Path, workers: int = 1, progress: bool = True) -> Manifest:
    """Every cloud of every split into shards under `root`; the manifest is written last.

    Killed and called again, it keeps the finished shards, those that `generate_part` made among them, and completes the
    rest, to the same bytes. On a finished folder it verifies every shard and makes anew only those missing, truncated
    or altered.

    Args:
        workers: processes; 1 stays in this one.
        progress: show a bar with the rate and the time left, where stderr is a terminal.

    Raises:
        ValueError: for a config that cannot be.
        ShardError: where the folder holds another config's shards, naming each differing value.
        FolderInUseError: where another process writes there.
        DiskFullError: where the shards do not fit.
    """
    root, tasks = Path(root), _checked(config)
    with sole_writer(root):
        remove_temporaries(root)
        request, manifest, whole = _completed(config, root, tasks, tasks, workers, progress)
        if manifest is None:
            manifest = Manifest.summarise(request["config"], [whole[task.file] for task in tasks])
            write_atomically(root / MANIFEST, manifest.to_json().encode())
        for path in (root / REQUEST, *(root / sidecar(task.file) for task in tasks)):
            path.unlink(missing_ok=True)
    return manifest


def generate_part(
    config: BenchmarkConfig, root: str | Path, part: Part, workers: int = 1, progress: bool = True
) -> list[ShardRecord]:
    """One part of the shards under `root`, beside other jobs that make the others, on this machine or any other.

    Jobs of different parts write different files, each whole or not at all, so they need no lock to be right. Where the
    file system has locks, a part keeps `generate_dataset` out, which writes the manifest when all parts are there.
    Killed and called again, it goes on where it was.

    Returns:
        The records of the part's shards, all of which are whole now.

    Raises:
        ValueError, DiskFullError: as `generate_dataset`, and so is ShardError.
        FolderInUseError: where `generate_dataset` works there.
    """
    root, tasks = Path(root), _checked(config)
    mine = part.of(tasks)
    with joint_writer(root):
        _, _, whole = _completed(config, root, tasks, mine, workers, progress)
    return [whole[task.file] for task in mine]


def _checked(config: BenchmarkConfig) -> list[Task]:
    """The tasks of a config that can be."""
    check_config(config)
    for split in config.splits:
        split_labels(config, split)
    return tasks_of(config)


def _completed(
    config: BenchmarkConfig, root: Path, tasks: list[Task], mine: list[Task], workers: int, progress: bool
) -> tuple[dict, Manifest | None, dict[str, ShardRecord]]:
    """Make what is missing of the tasks in `mine`; the folder's request and manifest, and those tasks' records."""
    request = request_of(config)
    manifest = read_manifest(root) if (root / MANIFEST).exists() else None
    refuse_other(root, request, manifest, tasks)
    whole = kept(root, mine, request, manifest)
    missing = [task for task in mine if task.file not in whole]
    require_room(root, _estimate(config, missing))
    if manifest is None and not (root / REQUEST).exists():
        write_atomically(root / REQUEST, json_text(request).encode())
    return request, manifest, whole | _make(config, root, mine, missing, manifest, workers, progress)


def _estimate(config: BenchmarkConfig, tasks: list[Task]) -> int:
    """Bytes that the tasks' shards will take, from a few clouds of each split."""
    total = 0.0
    for split in {task.split for task in tasks}:
        clouds = list(generate_clouds(config, split, range(min(PROBED_CLOUDS, config.splits[split].clouds))))
        size = sum(map(len, encode_shard(clouds, split)))
        total += size / len(clouds) * sum(t.clouds for t in tasks if t.split == split)
    return round(total)


def _make(
    config, root, tasks: list[Task], missing: list[Task], manifest, workers: int, progress: bool
) -> dict[str, ShardRecord]:
    """Write the missing shards, showing how far they are; their records by file."""
    expected = {each.file: each.sha256 for each in manifest.shards} if manifest else {}
    total = sum(task.clouds for task in tasks)
    done = total - sum(task.clouds for task in missing)
    made = {}
    with tqdm(total=total, initial=done, unit=" clouds", desc=root.name, disable=None if progress else True) as bar:
        for record in _produce(config, root, missing, expected, workers):
            made[record.file] = record
            bar.update(record.clouds)
    return made


def _produce(config, root, tasks: list[Task], expected: dict[str, str], workers: int) -> Iterator[ShardRecord]:
    """Write the tasks' shards and give their records as they are finished."""
    jobs = [(task, expected.get(task.file)) for task in tasks]
    with ProcessPool(min(workers, len(tasks)), config, root) as pool:
        try:
            yield from pool.results(_write_shard, jobs, in_order=False)
        except WorkerDiedError as error:
            raise RuntimeError(
                f"{error}; run the same command again, with fewer workers or smaller shards; finished shards are kept"
            ) from error


def _write_shard(config: BenchmarkConfig, root: Path, task: Task, expected: str | None) -> ShardRecord:
    """Generate and write one shard, then its sidecar; with an expected sha256 the manifest already records it."""
    clouds = list(generate_clouds(config, task.split, range(task.first, task.first + task.clouds)))
    content, digest = encode_shard(clouds, task.split), hashlib.sha256()
    for part in content:
        digest.update(part)
    sha256, size = digest.hexdigest(), sum(map(len, content))
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
        bytes=size,
        sha256=sha256,
    )
    with atomic_writer(root / task.file, size) as file:
        file.writelines(content)
    if expected is None:
        write_atomically(root / sidecar(task.file), sidecar_text(record, request_of(config)).encode())
    return record
