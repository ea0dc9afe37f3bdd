"""A small benchmark that the commands are tried on."""

from pathlib import Path

import pytest

from symshrec.benchmark.config import BenchmarkConfig, SplitConfig, SurfaceConfig
from symshrec.benchmark.generate import generate_dataset


@pytest.fixture(scope="session")
def shards(tmp_path_factory) -> Path:
    """Shards of 6 training and 18 test clouds."""
    root = tmp_path_factory.mktemp("benchmark") / "shards"
    surface = SurfaceConfig(points=200, citrus_points=400)
    splits = {"train": SplitConfig(clouds=6), "test": SplitConfig(clouds=18)}
    generate_dataset(BenchmarkConfig(surface=surface, splits=splits), root, workers=1, progress=False)
    return root
