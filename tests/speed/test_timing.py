"""What `bench` says of methods: lines that name what was timed, on the same clouds, with a ratio that fits them."""

import pytest
import torch

from symshrec.benchmark.cloud import PUBLISHED_PERTURBATIONS
from symshrec.methods.baselines.module import PcaIcp
from symshrec.methods.m3.module import M3
from symshrec.methods.m4.module import M4
from symshrec.methods.m4.settings import M4Settings
from symshrec.reporting.tables.typeset import markdown
from symshrec.runs.config import benchmark_of, load
from symshrec.speed.timing import batch_timing, benchmark_clouds, generator_timings, method_timings, timings_grid


@pytest.fixture(scope="module")
def clouds():
    small = ["data.benchmark.surface.points=1600", "data.benchmark.surface.citrus_points=1600"]
    return benchmark_clouds(benchmark_of(load(["data=smoke", *small])))


def seconds(text):
    return float(text.partition(" s")[0])


def test_the_timed_clouds_are_as_many_under_every_perturbation(clouds):
    names = [cloud.labels.perturbation for cloud in clouds]
    assert {name: names.count(name) for name in names} == dict.fromkeys(PUBLISHED_PERTURBATIONS, 7)


def test_the_generator_is_timed_beside_writing_and_beside_text(tmp_path):
    small = ["surface.points=200", "surface.citrus_points=200", "splits.train.clouds=84"]
    config = benchmark_of(load(["data=smoke", *(f"data.benchmark.{each}" for each in small)]))
    writing, text = generator_timings(config, tmp_path, 1)
    shards = sorted((tmp_path / "shards").glob("*.safetensors"))
    assert len(shards) == 6
    assert (tmp_path / "copy").read_bytes() == shards[-1].read_bytes()
    assert "against one text file a cloud" in text.what
    for timing in (writing, text):
        ours, other = (float(each.partition(" clouds/s")[0]) for each in (timing.ours, timing.other))
        assert timing.ratio == pytest.approx(ours / other, rel=0.05)


def test_methods_have_a_line_beside_each_other_way(clouds, monkeypatch):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    timings = list(method_timings(M3(), M4(), M4(M4Settings(rounds=0)), clouds[:2], [("PCA + ICP", PcaIcp())]))
    table = markdown(timings_grid(timings))
    for part in (
        "M3 (R1), median",
        "20–60 s",
        "M4, median",
        "0.119 s",
        "mean and longest",
        "against M3 (R1)",
        "M4 fast, median",
        "PCA + ICP, median a cloud, one core, against M4",
        "PCA + ICP, median a cloud, one core, against M3 (R1)",
    ):
        assert part in table
    for timing in timings:
        assert seconds(timing.ours) > 0
        assert timing.ratio == pytest.approx(seconds(timing.other) / seconds(timing.ours), rel=0.2)


def test_a_batch_is_timed_by_the_cloud(clouds):
    timing = batch_timing(M4(), clouds[:2], 1.0, "cpu")
    assert "2 in a batch on cpu" in timing.what
    assert timing.ratio == pytest.approx(1 / seconds(timing.ours), rel=0.05)
