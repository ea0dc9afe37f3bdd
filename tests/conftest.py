"""The smoke benchmark, generated once a session."""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # tests run beside each other's worker processes

import pytest
import torch

from symshrec.benchmark.generate import generate_dataset
from symshrec.runs.config import benchmark_of, load

torch.set_num_threads(1)
SMALL = [
    "data=smoke",
    "data.benchmark.surface.points=400",
    "data.benchmark.surface.citrus_points=500",
    "data.benchmark.clouds_per_shard=10",
]


@pytest.fixture(scope="session")
def smoke_root(tmp_path_factory):
    """Folder of the smoke benchmark with small clouds."""
    root = tmp_path_factory.mktemp("data") / "smoke"
    generate_dataset(benchmark_of(load(SMALL)), root, workers=1, progress=False)
    return root


@pytest.fixture
def small_benchmark():
    """Overrides that describe the smoke benchmark with small clouds, for a command line."""
    return SMALL


@pytest.fixture
def smoke_config(smoke_root, tmp_path):
    """overrides → configuration of a run over the smoke benchmark, in a folder of its own."""

    def compose(*overrides: str):
        places = [f"data.root={smoke_root}", f"folder={tmp_path / 'run'}", "trainer.enable_progress_bar=false"]
        quick = [] if any(each.startswith("method=") for each in overrides) else ["method.neighbours=20"]
        return load([*SMALL, *places, *quick, *overrides])

    return compose
