"""Streams of many keys at once are those that NumPy makes of each."""

import hashlib

import numpy as np
import pytest

from symshrec.benchmark.randomness import generator, generators


@pytest.mark.parametrize("seed", [0, 2023, 2**32, 2**70 + 17, 2**128 - 1, 2**128, 2**200 + 3])
def test_streams_are_those_of_numpys_own_seed_sequence(seed):
    split_number = int.from_bytes(hashlib.sha256(b"train").digest()[:4], "little")
    keys = [[index, stream] for index in (0, 1, 59_999, 2**32 - 1) for stream in range(3)]
    made = list(generators(seed, "train", np.array(keys)))
    assert len(made) == len(keys)
    for key, stream in zip(keys, made, strict=True):
        sequence = np.random.SeedSequence(seed, spawn_key=(split_number, *key))
        assert stream.bit_generator.state == np.random.PCG64(sequence).state
        np.testing.assert_array_equal(stream.normal(size=9), generator(seed, "train", *key).normal(size=9))
