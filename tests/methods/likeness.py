"""What the tests of methods share: weights of untrained networks, a cloud, and what its planes must not depend on."""

from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from symshrec.methods.learned import LearnedMethod
from symshrec.methods.settings import plain_settings
from symshrec.methods.weights import write_weights
from symshrec.planes import Planes, axis_angles


def stretched_cloud(count: int = 300, seed: int = 3) -> Tensor:
    """(count, 3) normal points, ten to five to two, so that no two of its axes are alike."""
    return torch.from_numpy(np.random.default_rng(seed).normal(size=(count, 3)) * [1.0, 0.5, 0.2]).float()


def assert_same_planes(planes: Planes, expected: Planes, atol: float = 1e-3) -> None:
    """The same planes in the same order: offsets and confidences within atol, normals within 100 atol degrees."""
    assert len(planes) == len(expected) > 0
    assert np.rad2deg(axis_angles(planes.normals, expected.normals).diagonal()).max() < 100 * atol
    gaps = np.einsum("kd,kd->k", planes.points - expected.points, expected.normals)
    np.testing.assert_allclose(gaps, 0, atol=atol)
    np.testing.assert_allclose(planes.confidences, expected.confidences, atol=atol)


def assert_blind_to_order_and_moving_with_the_cloud(method: LearnedMethod) -> None:
    """The same planes for the points in another order, and the moved planes for the moved and scaled cloud."""
    points = stretched_cloud()
    planes = method.detect(points)
    assert_same_planes(method.detect(points[torch.randperm(len(points))]), planes)
    moved = method.detect(3 * points + torch.tensor([1.0, -2, 0.5]))
    assert_same_planes(moved, planes.transformed(scale=3, translation=[1, -2, 0.5]), atol=1e-2)


def untrained_weights(folder: Path, method: str, network_of, settings) -> list[str]:
    """Two files of weights of `network_of(settings)`, as chance made them."""
    files = [str(folder / f"{seed}.safetensors") for seed in (0, 1)]
    for seed, file in enumerate(files):
        torch.manual_seed(seed)
        network = network_of(settings)
        network.train()(torch.randn(64, settings.points, 3))  # gives the norms their statistics
        write_weights(Path(file), method, plain_settings(settings), {"epochs": 0}, network.state_dict())
    return files
