"""The order of training clouds: every epoch once, rounds by number alone, processes apart."""

from itertools import chain

import pytest

from symshrec.data.rounds import RoundSampler


def drawn(sampler, rounds):
    batches = []
    for each in rounds:
        sampler.set_epoch(each)
        batches += list(sampler)
    return batches


def test_an_epoch_has_every_cloud_once_and_the_next_another_order():
    sampler = RoundSampler(clouds=20, batch_size=4, steps=5, seed=1)
    first, second = drawn(sampler, [0]), drawn(sampler, [1])
    for epoch in (first, second):
        assert sorted(chain(*epoch)) == list(range(20))
    assert first != second


def test_rounds_may_end_within_epochs_and_be_drawn_alone():
    whole = drawn(RoundSampler(23, 4, 15, seed=1), [0])
    assert drawn(RoundSampler(23, 4, 5, seed=1), [0, 1, 2]) == whole
    assert drawn(RoundSampler(23, 4, 5, seed=1), [2]) == whole[10:]
    assert drawn(RoundSampler(23, 4, 15, seed=2), [0]) != whole


def test_a_round_goes_on_within_and_the_next_is_whole():
    whole = drawn(RoundSampler(23, 4, 5, seed=1), [0, 1, 2])
    assert drawn(RoundSampler(23, 4, 5, seed=1, first=7), [1, 2]) == whole[7:]


def test_processes_share_an_epoch():
    parts = [drawn(RoundSampler(24, 4, 3, seed=1, rank=rank, processes=2), [0]) for rank in (0, 1)]
    assert sorted(chain(*parts[0], *parts[1])) == list(range(24))


def test_too_few_clouds_are_an_error():
    with pytest.raises(ValueError, match=r"7 training clouds do not fill 2 batch\(es\) of 4; lower train\.batch_size"):
        RoundSampler(7, 4, 5, seed=1, processes=2)
