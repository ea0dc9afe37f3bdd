"""Speeds and their ratios within one run: generator, scoring and methods beside the plain way of doing the same."""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import torch
from threadpoolctl import threadpool_limits
from torch import Tensor

from symshrec.benchmark.cloud import LabelledCloud
from symshrec.benchmark.config import BenchmarkConfig
from symshrec.benchmark.generate import generate_cloud, generate_dataset
from symshrec.benchmark.official import write_track
from symshrec.benchmark.shards import ShardedSplit
from symshrec.data.datamodule import collate
from symshrec.files.atomic import write_atomically
from symshrec.files.threads import one_thread
from symshrec.methods.base import SymmetryMethod
from symshrec.methods.m3.pipeline import spatial_order
from symshrec.metrics import evaluate
from symshrec.planes import PackedPlanes, Planes
from symshrec.reporting.tables.typeset import Grid, Text
from symshrec.speed.plain import m3 as plain_m3
from symshrec.speed.plain import m4 as plain_m4
from symshrec.speed.plain.metrics import evaluate_plainly

PUBLISHED_M3_SECONDS = "20–60 s"  # §3.3.1
PUBLISHED_M1_SECONDS = "0.119 s with a GPU"  # §3.1.1: the network 8.742 ms, what follows it 110.123 ms


@dataclass(frozen=True)
class Timing:
    """What was timed, ours and the other way's figure in the same unit, and how many times faster ours is."""

    what: str
    ours: str
    other: str
    ratio: float


def seconds_of(work: Callable[[], object], repeats: int = 1) -> float:
    """Median wall-clock seconds of `work`."""
    taken = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        taken.append(time.perf_counter() - start)
    return float(np.median(taken))


def generator_timings(config: BenchmarkConfig, folder: Path, workers: int) -> Iterator[Timing]:
    """Clouds/s of the generator beside writing the same bytes, the limit, and beside one text file a cloud."""
    clouds = sum(split.clouds for split in config.splits.values())
    made = seconds_of(lambda: generate_dataset(config, folder / "shards", workers, progress=False))
    shards = sorted((folder / "shards").glob("*.safetensors"))
    contents = [path.read_bytes() for path in shards]
    written = seconds_of(lambda: _write_all(folder, contents))
    split = ShardedSplit(folder / "shards", next(iter(config.splits)))
    few = [split[position] for position in range(min(42, len(split)))]
    text = seconds_of(lambda: write_track(few, folder / "text")) / len(few)
    text += seconds_of(lambda: [generate_cloud(config, split.split, cloud.id) for cloud in few]) / len(few)
    ours = clouds / made
    size = sum(map(len, contents)) / 1e6
    yield Timing(f"generator, {workers} processes: shards against writing the same {size:.0f} MB",
                 f"{ours:.0f} clouds/s", f"{clouds / written:.0f} clouds/s", written / made)  # fmt: skip
    yield Timing("generator: shards against one text file a cloud, same processes",
                 f"{ours:.0f} clouds/s", f"{workers / text:.0f} clouds/s", ours * text / workers)  # fmt: skip


def _write_all(folder: Path, contents: Sequence[bytes]) -> None:
    for content in contents:
        write_atomically(folder / "copy", content)


def scoring_timing(clouds: int = 9000, plain_clouds: int = 60) -> Timing:
    """Seconds for 9,000 clouds at 100 tolerance pairs, one core, beside a loop over clouds, pairs and planes."""
    rng = np.random.default_rng(0)
    truth = [Planes(rng.normal(size=(k, 3)), np.zeros((k, 3))) for k in rng.integers(1, 14, clouds)]
    predicted = [_jittered(planes, rng) for planes in truth]
    diagonals = rng.uniform(2, 5, clouds)
    thetas, epsilons = np.geomspace(0.05, 10, 10), np.geomspace(0.0005, 0.05, 10)
    packed = PackedPlanes.pack(predicted), PackedPlanes.pack(truth)
    with threadpool_limits(1):
        ours = seconds_of(lambda: evaluate(*packed, diagonals, thetas, epsilons))
        some = slice(0, plain_clouds)
        plain = seconds_of(
            lambda: [
                evaluate_plainly(predicted[some], truth[some], diagonals[some], theta, epsilon)
                for theta in thetas
                for epsilon in epsilons
            ]
        )
    plain *= clouds / plain_clouds
    return Timing(f"scoring: {clouds} clouds × 100 tolerance pairs, one core, against a loop", f"{ours:.1f} s",
                  f"{plain:.0f} s (from {plain_clouds} clouds)", plain / ours)  # fmt: skip


def _jittered(planes: Planes, rng: np.random.Generator) -> Planes:
    """Noisy copies of planes among as many false ones, with random confidences."""
    count = len(planes)
    normals = np.concatenate([planes.normals + 0.02 * rng.normal(size=(count, 3)), rng.normal(size=(count, 3))])
    points = 0.02 * rng.normal(size=(2 * count, 3))
    return Planes(normals, points, rng.uniform(size=2 * count))


def benchmark_clouds(config: BenchmarkConfig, split: str = "test") -> list[LabelledCloud]:
    """The clouds that methods are timed on, always the same: a whole split, balanced over the perturbations."""
    return [generate_cloud(config, split, index) for index in range(config.splits[split].clouds)]


def method_timings(
    m3: SymmetryMethod,
    m4: SymmetryMethod,
    fast: SymmetryMethod,
    clouds: Sequence[LabelledCloud],
    baselines: Sequence[tuple[str, SymmetryMethod]] = (),
) -> Iterator[Timing]:
    """Seconds a cloud of M3 (R1) and M4 on one core, beside plain versions of both and each other, on the same clouds.

    The named baselines follow, beside M4 and M3. Where there is a GPU, M4's on it too, a cloud's share of one batch of
    them all.
    """
    diffusion = _seconds_each(m3.detect, clouds)
    plain = _seconds_each(lambda points: plain_m3.detect_planes(spatial_order(points.double().numpy())), clouds)
    yield _medians(f"M3 (R1), median a cloud, one core, against a plain one (published: {PUBLISHED_M3_SECONDS})",
                   diffusion, plain)  # fmt: skip
    ours = _seconds_each(m4.detect, clouds)
    plain = _seconds_each(lambda points: plain_m4.detect_planes(points.numpy()), clouds)
    yield _medians(f"M4, median a cloud, one core, against a plain one (published, M1: {PUBLISHED_M1_SECONDS})",
                   ours, plain)  # fmt: skip
    yield Timing("M4, mean and longest, against the plain one's (ratio of means)",
                 f"{ours.mean():.3f} s, {ours.max():.3f} s",
                 f"{plain.mean():.3f} s, {plain.max():.3f} s", float(plain.mean() / ours.mean()))  # fmt: skip
    yield _medians("M4, median a cloud, one core, against M3 (R1)", ours, diffusion)
    yield _medians("M4 fast, median a cloud, one core, against M4", _seconds_each(fast.detect, clouds), ours)
    for name, baseline in baselines:
        seconds = _seconds_each(baseline.detect, clouds)
        for other, taken in (("M4", ours), ("M3 (R1)", diffusion)):
            yield _medians(f"{name}, median a cloud, one core, against {other}", seconds, taken)
    if torch.cuda.is_available():
        yield batch_timing(m4, clouds, float(ours.mean()), "cuda")


def batch_timing(method: SymmetryMethod, clouds: Sequence[LabelledCloud], core_seconds: float, device: str) -> Timing:
    """M4's mean seconds a cloud in one batch on a device, beside those on one core."""
    batch = collate([(position, cloud, None) for position, cloud in enumerate(clouds)]).to(device)
    method = method.to(device)
    method.detect_batch(batch)
    seconds = seconds_of(lambda: method.detect_batch(batch), repeats=3) / len(clouds)
    return Timing(f"M4, mean a cloud, {len(clouds)} in a batch on {device}, against one core",
                  f"{seconds:.4f} s", f"{core_seconds:.3f} s", core_seconds / seconds)  # fmt: skip


def _seconds_each(find: Callable[[Tensor], object], clouds: Sequence[LabelledCloud]) -> np.ndarray:
    """Seconds (C,) for every cloud on one core, the first of all done once before."""
    points = [torch.from_numpy(cloud.points) for cloud in clouds]
    with threadpool_limits(1), one_thread():
        find(points[0])
        return np.array([seconds_of(partial(find, each)) for each in points])


def _medians(what: str, ours: np.ndarray, other: np.ndarray) -> Timing:
    ours, other = np.median(ours), np.median(other)
    return Timing(what, f"{ours:.3f} s", f"{other:.3f} s", float(other / ours))


def timings_grid(timings: list[Timing]) -> Grid:
    """The timings as a printable table."""
    rows = [[Text(each.what), Text(each.ours), Text(each.other), Text(f"{each.ratio:.2f}×")] for each in timings]
    return Grid("Speeds", ["what", "ours", "the other way", "ours is faster by"], rows)
