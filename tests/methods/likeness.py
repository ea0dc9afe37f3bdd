"""What the tests of methods share: a cloud for the asking, and when two lists of planes are the same."""

import numpy as np
import torch
from torch import Tensor

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
