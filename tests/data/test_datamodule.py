"""The datamodule: whole clouds, honest folds, filters that bite, samples paid for once."""

import itertools

import numpy as np
import pytest
import torch

from symshrec.benchmark.official import write_track
from symshrec.benchmark.shards import ShardedSplit
from symshrec.data.datamodule import SymmetryDataModule
from symshrec.data.settings import DataKind, DataSettings, SamplingKind, SamplingSettings


def opened(root, stage="test", **options) -> SymmetryDataModule:
    module = SymmetryDataModule(DataSettings(root=str(root), **options))
    module.prepare_data()
    module.setup(stage)
    return module


def test_batches_hold_every_cloud_whole_whatever_the_batch_size(smoke_root):
    split = ShardedSplit(smoke_root, "test")
    for size, workers in ((5, 0), (42, 0), (8, 1)):
        module = opened(smoke_root, batch_size=size, workers=workers)
        seen = 0
        for batch in module.test_dataloader():
            for row, points in enumerate(batch.clouds):
                cloud = split[batch.positions[row]]
                np.testing.assert_array_equal(points, cloud.points)
                np.testing.assert_array_equal(batch.truth[row].normals, cloud.planes.normals)
                assert float(batch.diagonals[row]) == cloud.diagonal
                assert batch.labels[row].family == cloud.labels.family
                seen += 1
        assert seen == len(split) == 42


def test_folds_part_the_training_split(smoke_root):
    parts = []
    for fold in range(5):
        module = opened(smoke_root, "validate", fold=fold)
        val = set(module.datasets["val"].positions.tolist())
        assert module.training_clouds() + len(val) == 42
        parts.append(val)
    assert not any(a & b for a, b in itertools.combinations(parts, 2))
    assert set.union(*parts) == set(range(42))
    assert opened(smoke_root, "validate", fold=2).datasets["val"].positions.tolist() == sorted(parts[2])


def test_filters_keep_what_they_name(smoke_root):
    module = opened(smoke_root, perturbations=["P1", "P4"], families=["astroid", "citrus"])
    labels = [label for batch in module.test_dataloader() for label in batch.labels]
    assert sorted((each.family, each.perturbation) for each in labels) == [
        (family, perturbation) for family in ("astroid", "citrus") for perturbation in ("P1", "P4")
    ]
    assert len(opened(smoke_root, limit=3).datasets["test"]) == 3


@pytest.mark.parametrize("kind", [SamplingKind.farthest, SamplingKind.random])
def test_samples_are_points_of_their_cloud_and_survive_on_disk(smoke_root, kind, monkeypatch):
    options = {"sampling": SamplingSettings(kind, 64), "batch_size": 7}
    first = [batch.sampled for batch in opened(smoke_root, **options).test_dataloader()]
    monkeypatch.setattr("symshrec.data.samples._draw", lambda *_: pytest.fail("drawn twice"))
    module = opened(smoke_root, **options)
    for batch, sampled in zip(module.test_dataloader(), first, strict=True):
        torch.testing.assert_close(batch.sampled, sampled, rtol=0, atol=0)
        for cloud, points in zip(batch.clouds, sampled, strict=True):
            distinct = set(map(tuple, points.tolist()))
            assert distinct <= set(map(tuple, cloud.tolist()))
            assert len(distinct) == 64


def cut(data):
    return data[:-7]


def flipped(data):
    """In an index, which would be another of the cloud's points, or of no point."""
    return data[:-100] + bytes([data[-100] ^ 1]) + data[-99:]


@pytest.mark.parametrize("damage", [cut, flipped])
def test_a_damaged_sample_file_is_drawn_again(smoke_root, damage):
    options = {"sampling": SamplingSettings(SamplingKind.random, 16), "batch_size": 42}
    (before,) = [batch.sampled for batch in opened(smoke_root, **options).test_dataloader()]
    for path in (smoke_root / "samples" / "test").glob("random-16-*"):
        path.write_bytes(damage(path.read_bytes()))
    (after,) = [batch.sampled for batch in opened(smoke_root, **options).test_dataloader()]
    torch.testing.assert_close(after, before, rtol=0, atol=0)


def test_official_folders_give_the_same_batches(smoke_root, tmp_path):
    split = ShardedSplit(smoke_root, "test")
    write_track((split[i] for i in range(6)), tmp_path / "benchmark-test")
    module = opened(tmp_path, kind=DataKind.official, batch_size=6)
    (batch,) = module.test_dataloader()
    for row, points in enumerate(batch.clouds):
        np.testing.assert_allclose(points, split[row].points, atol=1e-6)
        assert len(batch.truth[row]) == len(split[row].planes)


def test_selected_clouds_stay_with_their_labels(smoke_root):
    (batch,) = opened(smoke_root, batch_size=42, sampling=SamplingSettings(SamplingKind.random, 8)).test_dataloader()
    part = batch.select([5, 0])
    assert part.positions == [batch.positions[5], batch.positions[0]]
    torch.testing.assert_close(part.clouds[0], batch.clouds[5])
    torch.testing.assert_close(part.sampled[1], batch.sampled[0])


def test_mistakes_are_named(smoke_root):
    with pytest.raises(ValueError, match=r"data\.perturbations holds \['P7x'\]; choose from P0"):
        SymmetryDataModule(DataSettings(root=str(smoke_root), perturbations=["P7x"]))
    with pytest.raises(ValueError, match=r"data\.fold is 5"):
        SymmetryDataModule(DataSettings(root=str(smoke_root), fold=5))
    with pytest.raises(ValueError, match=r"no samples; set data\.sampling"):
        _ = next(iter(opened(smoke_root).test_dataloader())).sampled
