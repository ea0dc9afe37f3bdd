"""What `bench` says of M2: its loss and its detection, each beside the plain way, on the same clouds."""

import pytest

from symshrec.benchmark.shards import ShardedSplit
from symshrec.methods.m2.module import M2
from symshrec.methods.m2.settings import M2Settings, NetworkSettings
from symshrec.speed.m2 import m2_timings

SMALL = NetworkSettings(points=64, groups=8, neighbours=8, width=12, depth=1, heads=2, planes=9, hidden=8)


def test_m2_has_a_line_for_its_loss_and_one_for_its_detection(smoke_root):
    split = ShardedSplit(smoke_root, "test")
    chamfer, detection = m2_timings(M2(M2Settings(network=SMALL)), [split[position] for position in range(3)])
    assert "9 mirror images of 64 points" in chamfer.what
    assert "network and cleaning" in detection.what
    for timing in (chamfer, detection):
        ours, other = (float(each.removesuffix(" ms")) for each in (timing.ours, timing.other))
        assert timing.ratio == pytest.approx(other / ours, rel=0.5)
