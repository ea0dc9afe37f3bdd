"""Training clouds from memory, from a mapped file and from the generator."""

from dataclasses import fields

import pytest
import torch

from symshrec.data.datamodule import SymmetryDataModule
from symshrec.data.settings import DataKind, DataSettings, SamplingKind, SamplingSettings
from symshrec.data.training import MappedDataset, SampledDataset
from symshrec.runs.config import benchmark_of, load

FARTHEST = SamplingSettings(SamplingKind.farthest, 24)


def training(root, **options) -> SymmetryDataModule:
    module = SymmetryDataModule(DataSettings(root=str(root), sampling=FARTHEST, **options), 7, 8, 6)
    module.setup("fit")
    return module


def assert_same(one, other):
    for each in fields(one):
        torch.testing.assert_close(getattr(one, each.name), getattr(other, each.name), rtol=0, atol=0)


def drawn(module, rounds=1):
    loader, batches = module.train_dataloader(), []
    for number in range(rounds):
        loader.sampler.set_epoch(number)
        batches += list(loader)
    return batches


def cut(data):
    return data[:-12]


def flipped(data):
    return data[:100] + bytes([data[100] ^ 1]) + data[101:]


def test_mapped_points_are_those_in_memory(smoke_root):
    held, mapped = training(smoke_root, in_memory=True), training(smoke_root, in_memory=False)
    assert isinstance(held.datasets["train"], SampledDataset)
    assert isinstance(mapped.datasets["train"], MappedDataset)
    for one, other in zip(drawn(held), drawn(mapped), strict=True):
        assert_same(one, other)


@pytest.mark.parametrize("file", ["bin", "safetensors"])
@pytest.mark.parametrize("damage", [cut, flipped])
def test_a_damaged_mapped_file_is_made_again(smoke_root, file, damage):
    before = training(smoke_root, in_memory=False).datasets["train"]
    rows = list(range(len(before)))
    wanted = before[rows]
    path = smoke_root / "samples" / "train" / f"points-farthest-24.{file}"
    whole = path.read_bytes()
    path.write_bytes(damage(whole))
    assert_same(training(smoke_root, in_memory=False).datasets["train"][rows], wanted)
    assert path.read_bytes() == whole


def test_streamed_batches_are_the_same_for_every_number_of_processes(small_benchmark, tmp_path):
    options = {"stream": True, "benchmark": benchmark_of(load(small_benchmark))}
    alone = drawn(training(tmp_path, **options), rounds=2)
    both = drawn(training(tmp_path, workers=2, **options), rounds=2)
    assert len(alone) == 12
    for one, other in zip(alone, both, strict=True):
        assert_same(one, other)
    assert len({cloud.numpy().tobytes() for batch in alone for cloud in batch.points}) == 12 * 8
    assert not any(tmp_path.iterdir())


def test_a_stream_keeps_to_the_filters(small_benchmark, tmp_path):
    benchmark = benchmark_of(load(small_benchmark))
    module = training(tmp_path, stream=True, benchmark=benchmark, families=["astroid", "citrus"])
    assert module.training_clouds() == 12
    clouds = module.datasets["train"].stream
    assert {clouds[number].labels.family for number in range(24)} == {"astroid", "citrus"}


def test_what_cannot_be_streamed_is_named(tmp_path):
    with pytest.raises(ValueError, match=r"data\.stream=true needs data that are generated.*official"):
        DataSettings(root=str(tmp_path), kind=DataKind.official, stream=True)
    with pytest.raises(ValueError, match=r"data\.solids"):
        DataSettings(root=str(tmp_path), solids=["cone"], stream=True)
