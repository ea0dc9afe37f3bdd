"""The same run twice gives the same bytes, whatever seed a process hashes strings with."""

import os
import subprocess
import sys

import numpy as np
import pytest
from safetensors import numpy as reference
from safetensors import safe_open

from symshrec.files.tensors import save

PROGRAM = """
import hashlib, sys
from pathlib import Path
import numpy as np, torch
from symshrec.files.predictions import PredictionStore
from symshrec.methods.weights import write_weights
from symshrec.planes import Planes

folder = Path(sys.argv[1])
store = PredictionStore(folder / "predictions", "key")
store.append([0], [7], [Planes(np.eye(3), np.zeros((3, 3)), np.arange(3) / 3)])
whole = store.consolidate({"method": "m4", "data": "d", "config": "c", "count_threshold": "0.5"})
weights = folder / "m1.safetensors"
write_weights(weights, "m1", {"points": 64}, {"epochs": 1}, {"a.weight": torch.ones(2, 3), "a.bias": torch.zeros(2)})
print(*(hashlib.sha256(path.read_bytes()).hexdigest() for path in (whole, weights)))
"""


def test_two_processes_write_the_same_bytes(tmp_path):
    digests = set()
    for seed in ("1", "2"):
        environment = {**os.environ, "PYTHONHASHSEED": seed}
        command = [sys.executable, "-c", PROGRAM, str(tmp_path / seed)]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
        digests.add(done.stdout)
    assert len(digests) == 1


def test_what_is_saved_is_what_the_library_reads(tmp_path):
    rng = np.random.default_rng(0)
    tensors = {
        "scalar": np.array(3, np.int64),
        "half": rng.normal(size=(3, 5)).astype(np.float16),
        "turned": rng.normal(size=(4, 2)).T,
        "empty": np.zeros((0, 3), np.uint8),
    }
    metadata = {f"key {number}": f'"θ" \\ \n{number}' for number in range(9)}
    path = tmp_path / "file.safetensors"
    path.write_bytes(save(tensors, metadata))
    with safe_open(path, framework="numpy") as file:
        assert file.metadata() == metadata
        for name, array in tensors.items():
            np.testing.assert_array_equal(file.get_tensor(name), array, strict=True)


@pytest.mark.parametrize("metadata", [None, {"symshrec": '{"split": "train", "größe": 1e-3}\t/'}])
def test_one_string_or_none_is_stored_as_the_library_does(metadata):
    tensors = {"a": np.arange(3.0), "b": np.arange(5, dtype=np.uint8)}
    assert save(tensors, metadata) == reference.save(tensors, metadata)


def test_metadata_are_strings():
    with pytest.raises(TypeError, match="metadata 'epochs' is int"):
        save({"a": np.zeros(1)}, {"epochs": 3})
