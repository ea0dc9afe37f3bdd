"""Shards on disk: what is read is what was generated, and damage is found before use."""

import json
import pickle
import sys
from dataclasses import replace
from subprocess import run

import numpy as np
import pytest
from safetensors.numpy import load, save

from symshrec.benchmark import shards
from symshrec.benchmark.config import BenchmarkConfig, PoseConfig, PoseGroup, SplitConfig, SurfaceConfig
from symshrec.benchmark.generate import generate_cloud, generate_clouds, generate_dataset
from symshrec.benchmark.shard_file import encode_shard
from symshrec.benchmark.shards import ShardedSplit, ShardError, read_manifest

CONFIG = BenchmarkConfig(
    surface=SurfaceConfig(points=200, citrus_points=400),
    pose=PoseConfig(PoseGroup.so3),
    splits={"train": SplitConfig(50), "test": SplitConfig(42)},
    clouds_per_shard=16,
)


@pytest.fixture(scope="module")
def pristine(tmp_path_factory):
    root = tmp_path_factory.mktemp("shards")
    generate_dataset(CONFIG, root, workers=1, progress=False)
    return root


@pytest.fixture
def root(pristine, tmp_path):
    for path in pristine.iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    return tmp_path


@pytest.mark.parametrize("split", ["train", "test"])
def test_what_is_read_is_what_was_generated(pristine, split):
    clouds = ShardedSplit(pristine, split)
    assert len(clouds) == CONFIG.splits[split].clouds
    for index in np.random.default_rng(0).permutation(len(clouds)):
        read, made = clouds[index], generate_cloud(CONFIG, split, int(index))
        assert read.points.dtype == np.float32
        np.testing.assert_array_equal(read.points, made.points)
        np.testing.assert_allclose(read.planes.normals, made.planes.normals, atol=1e-15)
        np.testing.assert_array_equal(read.planes.points, made.planes.points)
        for labels in (read.labels, clouds.labels(index)):
            np.testing.assert_array_equal(labels.rotation, made.labels.rotation)
            np.testing.assert_array_equal(labels.translation, made.labels.translation)
            assert labels.parameters == made.labels.parameters
            named = (labels.family, labels.solid, labels.perturbation)
            assert named == (made.labels.family, made.labels.solid, made.labels.perturbation)
            assert named == (clouds.families[index], clouds.solids[index], clouds.perturbations[index])
        assert (read.id, read.name) == (made.id, made.name)


@pytest.mark.parametrize("families", [None, {"planeless": 9}])
def test_a_shard_is_the_file_that_the_safetensors_library_writes(families):
    config = replace(CONFIG, splits={"test": SplitConfig(9, families=families)})
    clouds = list(generate_clouds(config, "test", range(9)))
    data = b"".join(encode_shard(clouds, "test"))
    arrays = load(data)
    np.testing.assert_array_equal(arrays["points"], np.concatenate([cloud.points for cloud in clouds]))
    header = json.loads(data[8 : 8 + int.from_bytes(data[:8], "little")])
    assert save(arrays, header["__metadata__"]) == data


def test_a_shard_of_clouds_without_truth_is_refused_by_name():
    withheld = replace(generate_cloud(CONFIG, "test", 0), planes=None)
    with pytest.raises(ValueError, match=f"cloud {withheld.name} are withheld"):
        encode_shard([withheld], "test")


def test_positions_outside_are_an_index_error_and_negative_ones_count_back(pristine):
    clouds = ShardedSplit(pristine, "train")
    assert clouds[-1].id == 49
    for index in (50, -51):
        with pytest.raises(IndexError, match=f"cloud {index} of 50 in split 'train'"):
            clouds[index]
    assert len(list(clouds)) == 50


def test_clouds_are_free_to_change(pristine):
    clouds = ShardedSplit(pristine, "train")
    before = clouds[0]
    for array in (before.points, before.planes.normals, before.planes.points, before.labels.rotation):
        array[:] = 0
    clouds.families[:] = "?"
    np.testing.assert_array_equal(clouds[0].points, generate_cloud(CONFIG, "train", 0).points)
    assert np.abs(clouds[0].planes.normals).max() > 0
    assert "?" not in clouds.families


def test_pickles_small_and_reads_in_another_process(pristine):
    clouds = ShardedSplit(pristine, "test")
    points = clouds[7].points
    data = pickle.dumps(clouds)
    assert len(data) < 10_000
    np.testing.assert_array_equal(pickle.loads(data)[7].points, points)


def test_few_shards_stay_mapped(pristine, monkeypatch):
    monkeypatch.setattr(shards, "MAPPED_SHARDS", 2)
    clouds = ShardedSplit(pristine, "train")
    for index in (0, 20, 40, 49, 0):
        np.testing.assert_array_equal(clouds[index].points, generate_cloud(CONFIG, "train", index).points)
        assert len(clouds._mapped) <= 2


def test_manifest_says_what_the_split_holds(pristine):
    manifest = read_manifest(pristine)
    clouds = ShardedSplit(pristine, "train")
    summary = manifest.splits["train"]
    for counts, names in (
        (summary.families, clouds.families),
        (summary.solids, clouds.solids),
        (summary.perturbations, clouds.perturbations),
    ):
        assert counts == dict(zip(*np.unique(names, return_counts=True), strict=True))
    assert summary.points == sum(len(cloud.points) for cloud in clouds)
    assert summary.max_planes == max(len(cloud.planes) for cloud in clouds)
    assert manifest.seed == 2023
    assert manifest.config["pose"]["group"] == "so3"
    assert ".json" not in {path.suffix for path in pristine.iterdir() if path.name != "manifest.json"}


def test_truncated_altered_and_missing_shards_are_named_before_use(root):
    (root / "train-00000.safetensors").unlink()
    data = (root / "train-00001.safetensors").read_bytes()
    (root / "train-00001.safetensors").write_bytes(data[:-10])
    data = bytearray((root / "train-00002.safetensors").read_bytes())
    data[-1] ^= 1
    (root / "train-00002.safetensors").write_bytes(data)
    with pytest.raises(ShardError, match=r"symshrec generate") as error:
        ShardedSplit(root, "train")
    lines = str(error.value).splitlines()
    assert "train-00000.safetensors is missing" in lines[0]
    assert "train-00001.safetensors has" in lines[1]
    assert "truncated" in lines[1]
    assert "train-00002.safetensors has other contents" in lines[2]
    assert len(ShardedSplit(root, "test")) == 42
    with pytest.raises(ShardError, match=r"train-00001.*truncated"):
        ShardedSplit(root, "train", verify=False)
    generate_dataset(CONFIG, root, workers=1, progress=False)
    assert len(ShardedSplit(root, "train")) == 50


def test_an_unverified_shard_of_nonsense_is_an_error_of_ours(root):
    path = root / "test-00000.safetensors"
    path.write_bytes(b"\xff" * path.stat().st_size)
    clouds = ShardedSplit(root, "test", verify=False)
    with pytest.raises(ShardError, match=r"test-00000\.safetensors is not a readable shard"):
        clouds[0]


def test_manifest_errors_say_what_to_do(root):
    with pytest.raises(ShardError, match="no split 'val'; it has"):
        ShardedSplit(root, "val")
    text = (root / "manifest.json").read_text()
    for content, message in (
        (text.replace('"generator_version": 2', '"generator_version": 0'), "generator version 0"),
        (text[: len(text) // 2], "not readable"),
        ("[]", "no manifest of shards"),
        (text.replace('"sha256"', '"sha"'), "no manifest of shards"),
    ):
        (root / "manifest.json").write_text(content)
        with pytest.raises(ShardError, match=message):
            read_manifest(root)
    (root / "manifest.json").unlink()
    with pytest.raises(ShardError, match="no shards here"):
        read_manifest(root)
    (root / "request.json").write_text("{}")
    with pytest.raises(ShardError, match="unfinished"):
        read_manifest(root)


def test_the_benchmark_never_imports_torch():
    code = "import sys, symshrec.benchmark.generate, symshrec.benchmark.shards; sys.exit('torch' in sys.modules)"
    assert run([sys.executable, "-c", code], check=False).returncode == 0
