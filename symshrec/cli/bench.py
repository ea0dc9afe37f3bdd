"""`symshrec bench`: speeds as ratios within one run (on an idle machine)."""

import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, cast

from omegaconf import DictConfig

from symshrec.runs.command import entry
from symshrec.runs.config import benchmark_of, load, method_of

if TYPE_CHECKING:
    from symshrec.methods.m1.module import M1
    from symshrec.methods.m2.module import M2
    from symshrec.speed.timing import Timing

PAPER_SIZED = ["data=smoke", "data.benchmark.splits.train.clouds=4200", "data.benchmark.clouds_per_shard=105"]
BASELINES = {"pca_icp": "PCA + ICP", "ransac": "RANSAC + ICP"}


@entry
def command(config: DictConfig) -> None:
    """Time each part, print a line as it is done, then the table."""
    from symshrec.reporting.tables.typeset import markdown
    from symshrec.runs.provenance import hardware
    from symshrec.speed.timing import timings_grid

    timings = []
    for timing in _timings(config.workers):
        timings.append(timing)
        print(f"{timing.what}: {timing.ours}", flush=True)
    machine = hardware()
    print(
        f"\n{markdown(timings_grid(timings))}\n{machine['cpu']}, {machine['cores']} cores, {machine['gpu'] or 'no GPU'}"
    )


def _timings(workers: int) -> Iterator["Timing"]:
    from symshrec.speed.m1 import m1_timings
    from symshrec.speed.m2 import m2_timings
    from symshrec.speed.timing import benchmark_clouds, generator_timings, method_timings, scoring_timing

    benchmark = benchmark_of(load(PAPER_SIZED))
    with tempfile.TemporaryDirectory(dir=Path.cwd()) as folder:
        yield from generator_timings(benchmark, Path(folder), workers)
    yield scoring_timing()
    m3, m4, fast = (method_of(load([f"experiment={name}"])) for name in ("m3_r1", "m4", "m4_fast"))
    clouds = benchmark_clouds(benchmark)
    baselines = [(title, method_of(load([f"method={name}"]))) for name, title in BASELINES.items()]
    yield from method_timings(m3, m4, fast, clouds, baselines)
    yield from m1_timings(cast("M1", method_of(load(["experiment=m1_r4"]))), clouds)
    yield from m2_timings(cast("M2", method_of(load(["method=m2"]))), clouds)
