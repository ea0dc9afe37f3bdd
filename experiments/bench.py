"""Speeds as ratios within one run: `python experiments/bench.py` (run it on an idle machine)."""

import tempfile
from pathlib import Path

from omegaconf import DictConfig

from symshrec.configs import benchmark_of, entry, load
from symshrec.provenance import hardware
from symshrec.reporting.benchmarks import generator_timings, m3_timing, scoring_timing, timings_grid
from symshrec.reporting.typeset import markdown

PAPER_SIZED = ["data=smoke", "data.benchmark.splits.train.clouds=2100", "data.benchmark.clouds_per_shard=105"]


@entry
def bench(config: DictConfig) -> None:
    """Time each part, print a line as it is done, then the table."""
    benchmark = benchmark_of(load(PAPER_SIZED))
    timings = []
    with tempfile.TemporaryDirectory(dir=Path.cwd()) as folder:
        for timing in generator_timings(benchmark, Path(folder), config.workers):
            timings.append(timing)
            print(f"{timing.what}: {timing.ours}", flush=True)
    for work in (scoring_timing, lambda: m3_timing(benchmark)):
        timings.append(work())
        print(f"{timings[-1].what}: {timings[-1].ours}", flush=True)
    machine = hardware()
    print(f"\n{markdown(timings_grid(timings))}\n{machine['cpu']}, {machine['cores']} cores")


if __name__ == "__main__":
    bench()
