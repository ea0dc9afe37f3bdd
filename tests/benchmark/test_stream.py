"""Clouds without a disk: a split's own, and endless further ones like them."""

from collections import Counter

import numpy as np
import pytest

from symshrec.benchmark.shards import ShardedSplit
from symshrec.benchmark.stream import CloudStream, GeneratedSplit
from symshrec.runs.config import benchmark_of, load


@pytest.fixture
def config(small_benchmark):
    return benchmark_of(load(small_benchmark))


def odd(split):
    return np.arange(len(split))[1::2]


def test_a_generated_split_holds_what_its_shards_hold(config, smoke_root):
    made, read = GeneratedSplit(config, "train"), ShardedSplit(smoke_root, "train")
    np.testing.assert_array_equal(made.families, read.families)
    np.testing.assert_array_equal(made.perturbations, read.perturbations)
    for position in (0, 17, len(read) - 1):
        np.testing.assert_array_equal(made[position].points, read[position].points)
        np.testing.assert_array_equal(made[position].planes.normals, read[position].planes.normals)


def test_a_stream_has_the_split_s_counts_in_every_epoch_and_no_cloud_twice(config):
    stream, split = CloudStream(config, "train"), GeneratedSplit(config, "train")
    size = stream.epoch_clouds
    assert size == len(split)
    clouds = [stream[number] for number in range(2 * size)]
    for epoch in (clouds[:size], clouds[size:]):
        assert Counter(each.labels.family for each in epoch) == Counter(split.families.tolist())
    firsts = {each.points[0].tobytes() for each in [*clouds, *(split[place] for place in range(size))]}
    assert len(firsts) == 3 * size


def test_a_cloud_of_a_stream_is_known_by_its_number_alone(config):
    ahead, back = CloudStream(config, "train", odd), CloudStream(config, "train", odd)
    numbers = [0, 7, ahead.epoch_clouds, 5 * ahead.epoch_clouds + 3]
    assert ahead.epoch_clouds == 21
    there = {number: ahead[number].points for number in numbers}
    for number in reversed(numbers):
        np.testing.assert_array_equal(back[number].points, there[number])
    first_of_all = CloudStream(config, "train")[1].points
    np.testing.assert_array_equal(there[0], first_of_all)
