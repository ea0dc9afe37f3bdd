"""One rotation from a quaternion, whoever holds it."""

import subprocess
import sys

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from symshrec.geometry.rotations import axis_rotation, rotation_matrices, uniform_rotation

QUATERNIONS = np.random.default_rng(0).normal(size=(50, 4))
QUATERNIONS /= np.linalg.norm(QUATERNIONS, axis=1, keepdims=True)


def test_arrays_and_tensors_give_scipys_matrices():
    expected = Rotation.from_quat(QUATERNIONS[:, [1, 2, 3, 0]]).as_matrix()
    np.testing.assert_allclose(rotation_matrices(QUATERNIONS), expected, atol=1e-14)
    of_tensors = rotation_matrices(torch.from_numpy(QUATERNIONS))
    np.testing.assert_array_equal(of_tensors.numpy(), rotation_matrices(QUATERNIONS))
    assert rotation_matrices(torch.from_numpy(QUATERNIONS).float().view(5, 10, 4)).shape == (5, 10, 3, 3)
    with pytest.raises(ValueError, match=r"shape \(50, 3\), expected \(\.\.\., 4\)"):
        rotation_matrices(QUATERNIONS[:, :3])


def test_torch_is_not_imported_for_arrays():
    program = (
        "import sys, numpy as np; from symshrec.geometry.rotations import uniform_rotation\n"
        "uniform_rotation(np.random.default_rng(0)); print('torch' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


@pytest.mark.parametrize("axis", range(3))
def test_axis_rotations_are_scipys(axis):
    np.testing.assert_allclose(axis_rotation(axis, 0.7), Rotation.from_euler("xyz"[axis], 0.7).as_matrix(), atol=1e-15)


def test_uniform_rotations_carry_a_point_all_over_the_sphere():
    rng = np.random.default_rng(0)
    images = np.array([uniform_rotation(rng)[:, 0] for _ in range(2000)])
    assert np.abs(images.mean(0)).max() < 0.05
    np.testing.assert_allclose(images.T @ images / 2000, np.eye(3) / 3, atol=0.03)
