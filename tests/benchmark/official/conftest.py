"""Random planes and clouds to write and read."""

from collections.abc import Callable

import numpy as np
import pytest

from symshrec.benchmark.cloud import LabelledCloud, Labels
from symshrec.planes import Planes


def random_planes(rng: np.random.Generator, count: int) -> Planes:
    normals = rng.normal(size=(count, 3))
    normals[::3] = np.round(normals[::3])  # whole directions, (1, 1, 1) and (1, 0, 0) among them
    normals[~normals.any(axis=1)] = 1
    return Planes(normals, rng.normal(scale=3, size=(count, 3)), rng.random(count))


def random_cloud(rng: np.random.Generator, cloud: int, labels: Labels | None = None) -> LabelledCloud:
    points = rng.normal(scale=2, size=(int(rng.integers(1, 60)), 3)).astype(np.float32)
    return LabelledCloud(
        points, random_planes(rng, int(rng.integers(0, 14))), labels or Labels(), cloud, f"cloud {cloud}"
    )


@pytest.fixture(name="random_planes")
def random_planes_fixture() -> Callable[..., Planes]:
    """(rng, count) → planes, some along whole directions."""
    return random_planes


@pytest.fixture(name="random_cloud")
def random_cloud_fixture() -> Callable[..., LabelledCloud]:
    """(rng, cloud ID, labels) → a cloud of a few points and planes."""
    return random_cloud
