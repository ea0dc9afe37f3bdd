"""The generator: clouds that depend on (seed, split, index) alone, generation that survives any end."""

import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from types import SimpleNamespace

import numpy as np
import pytest

from symshrec.benchmark.cloud import FAMILIES, PUBLISHED_PERTURBATIONS
from symshrec.benchmark.config import (
    BenchmarkConfig,
    HardConfig,
    PlanelessConfig,
    PoseConfig,
    PoseGroup,
    ScanConfig,
    SplitConfig,
    SurfaceConfig,
)
from symshrec.benchmark.generate import generate_cloud, generate_clouds, generate_dataset
from symshrec.benchmark.manifest import ShardError, read_manifest
from symshrec.benchmark.shards import ShardedSplit
from symshrec.files.atomic import DiskFullError, FolderInUseError, sole_writer


def small_config(train=84, test=42, clouds_per_shard=21, points=640):
    return BenchmarkConfig(
        surface=SurfaceConfig(points=points, citrus_points=2 * points),
        splits={"train": SplitConfig(train), "test": SplitConfig(test)},
        clouds_per_shard=clouds_per_shard,
    )


def contents(root):
    return {path.name: path.read_bytes() for path in root.iterdir()}


def same_cloud(one, other):
    np.testing.assert_array_equal(one.points, other.points)
    np.testing.assert_array_equal(one.planes.normals, other.planes.normals)
    assert one.labels.parameters == other.labels.parameters
    assert (one.id, one.name) == (other.id, other.name)


def test_a_cloud_depends_on_seed_split_and_index_alone():
    config = small_config()
    clouds = [generate_cloud(config, "train", index) for index in (3, 4)]
    config.clouds_per_shard = 7
    same_cloud(clouds[1], generate_cloud(config, "train", 4))
    same_cloud(clouds[0], generate_cloud(config, "train", 3))
    for one, other in zip(generate_clouds(config, "train", [4, 3]), clouds[::-1], strict=True):
        same_cloud(one, other)
    heights = {cloud.labels.parameters["height"] for cloud in clouds}
    heights.add(generate_cloud(config, "test", 3).labels.parameters["height"])
    config.seed = 1
    heights.add(generate_cloud(config, "train", 3).labels.parameters["height"])
    assert len(heights) == 4
    for index in (84, -1):
        with pytest.raises(IndexError, match=f"cloud {index} of split 'train', which has 84"):
            generate_cloud(config, "train", index)
        with pytest.raises(IndexError, match=f"cloud {index} of split 'train', which has 84"):
            list(generate_clouds(config, "train", [0, index]))
    with pytest.raises(ValueError, match="no split 'val'; it has train, test"):
        generate_cloud(config, "val", 0)


def test_another_pose_or_noise_leaves_the_shape_as_it_is():
    config = BenchmarkConfig(splits={"train": SplitConfig(12, {"P2": 12})}, pose=PoseConfig(PoseGroup.none))
    first = [generate_cloud(config, "train", index) for index in range(12)]
    config.noise.gaussian_power = 2.0
    config.pose.group = PoseGroup.so3
    for index, cloud in enumerate(first):
        other = generate_cloud(config, "train", index)
        unposed = (other.points - other.labels.translation) @ other.labels.rotation
        assert other.labels.parameters == cloud.labels.parameters
        still = (np.abs(unposed - cloud.points) < 1e-5).all(axis=1).mean()
        assert still == pytest.approx(1 - cloud.labels.parameters["noise_fraction"], abs=0.01)


def test_perturbations_beyond_the_paper_come_only_where_named_and_change_no_other_data(tmp_path):
    config = small_config()
    manifest = generate_dataset(config, tmp_path / "paper", progress=False)
    config.noise.hard = HardConfig(hole_probability=0.0)
    generate_dataset(config, tmp_path / "other", progress=False)
    assert contents(tmp_path / "paper") == contents(tmp_path / "other")
    assert rb"\"P6" not in b"".join(contents(tmp_path / "paper").values())
    names = {"P6": 14, "P7": 7, "P8": 7, "P9": 14}
    config.splits["test"] = SplitConfig(42, names)
    other = generate_dataset(config, tmp_path / "hard", progress=False)
    assert other.splits["test"].perturbations == names
    assert other.config["noise"]["hard"]["hole_probability"] == 0
    train = [[each for each in made.shards if each.split == "train"] for made in (manifest, other)]
    assert train[0] == train[1]
    assert "scan" not in other.config["noise"]
    assert "planeless" not in other.config
    config.noise.scan = ScanConfig(bend=[0.0, 0.0])
    config.planeless = PlanelessConfig(shear=[2.0, 2.0])
    assert generate_dataset(config, tmp_path / "unscanned", progress=False) == other
    split = ShardedSplit(tmp_path / "hard", "test")
    for index in (0, 41):
        same_cloud(split[index], generate_cloud(config, "test", index))
        assert split[index].labels.perturbation == split.perturbations[index]


def test_worker_count_and_order_change_no_byte_and_shard_size_no_cloud(tmp_path):
    config = small_config()
    manifest = generate_dataset(config, tmp_path / "one", workers=1, progress=False)
    assert generate_dataset(config, tmp_path / "three", workers=3, progress=False) == manifest
    assert contents(tmp_path / "one") == contents(tmp_path / "three")
    assert sorted(contents(tmp_path / "one")) == sorted(["manifest.json", *(each.file for each in manifest.shards)])
    assert read_manifest(tmp_path / "one").hash == manifest.hash
    config.clouds_per_shard = 100
    other = generate_dataset(config, tmp_path / "large", workers=1, progress=False)
    assert other.splits == manifest.splits
    assert manifest.splits["train"].families == dict.fromkeys(FAMILIES, 12)
    assert manifest.splits["test"].perturbations == dict.fromkeys(PUBLISHED_PERTURBATIONS, 7)
    planes = [
        len(generate_cloud(config, split, i).planes) for split, n in (("train", 84), ("test", 42)) for i in range(n)
    ]
    assert manifest.max_planes == max(planes)


GENERATE = """
import sys
from pathlib import Path
from symshrec.benchmark.config import BenchmarkConfig, SplitConfig, SurfaceConfig
from symshrec.benchmark.generate import generate_dataset
generate_dataset(BenchmarkConfig(surface=SurfaceConfig(points=640, citrus_points=1280),
    splits={"train": SplitConfig(210), "test": SplitConfig(42)}, clouds_per_shard=7), Path(sys.argv[1]), workers=2)
"""


def test_workers_do_not_import_the_main_program(tmp_path):
    program = tmp_path / "program.py"
    program.write_text('print("imported", flush=True)' + GENERATE)
    root = tmp_path / "out"
    ran = subprocess.run([sys.executable, program, root], capture_output=True, text=True, check=True)
    assert ran.stdout.split() == ["imported"]
    assert read_manifest(root).splits["test"].clouds == 42


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory):
    root = tmp_path_factory.mktemp("uninterrupted")
    generate_dataset(small_config(210, 42, 7), root, workers=1, progress=False)
    return contents(root)


@pytest.mark.parametrize(("shards_before", "whole_group"), [(12, False), (1, True)])
def test_killed_and_started_again_gives_the_same_bytes(shards_before, whole_group, uninterrupted, tmp_path):
    run = subprocess.Popen([sys.executable, "-c", GENERATE, tmp_path], stderr=subprocess.PIPE, start_new_session=True)
    deadline = time.monotonic() + 30
    while len(list(tmp_path.glob("*-*.json"))) < shards_before:
        assert time.monotonic() < deadline
        assert run.poll() is None
    (os.killpg if whole_group else os.kill)(run.pid, signal.SIGKILL)
    run.communicate(timeout=10)  # the pipe ends when the last worker is gone, orphans included
    assert not (tmp_path / "manifest.json").exists()
    (tmp_path / ".train-00001.safetensors.99.partial").write_bytes(b"half a shard")
    damaged, *whole = [path.with_suffix(".safetensors") for path in tmp_path.glob("*-*.json")]
    damaged.write_bytes(damaged.read_bytes()[:-1])
    times = [path.stat().st_mtime_ns for path in whole]
    generate_dataset(small_config(210, 42, 7), tmp_path, workers=1, progress=False)
    assert contents(tmp_path) == uninterrupted
    assert [path.stat().st_mtime_ns for path in whole] == times


def test_damaged_shards_of_a_finished_folder_are_made_anew_and_no_others(uninterrupted, tmp_path, monkeypatch):
    root = tmp_path / "out"
    generate_dataset(small_config(210, 42, 7), root, workers=1, progress=False)
    manifest = (root / "manifest.json").read_bytes()
    for name in ("train-00003.safetensors", "test-00000.safetensors"):
        data = bytearray((root / name).read_bytes())
        data[-100] ^= 1
        (root / name).write_bytes(data)
    (root / "train-00005.safetensors").unlink()
    untouched = (root / "train-00004.safetensors").stat().st_mtime_ns
    generate_dataset(small_config(210, 42, 7), root, workers=1, progress=False)
    assert contents(root) == uninterrupted
    assert (root / "manifest.json").read_bytes() == manifest
    assert (root / "train-00004.safetensors").stat().st_mtime_ns == untouched
    (root / "train-00005.safetensors").unlink()
    monkeypatch.setattr("symshrec.benchmark.generate.encode_shard", lambda clouds, split: [b"a later version's"])
    with pytest.raises(ShardError, match=r"train-00005.*cannot be made anew as the manifest records it"):
        generate_dataset(small_config(210, 42, 7), root, workers=1, progress=False)
    assert not (root / "train-00005.safetensors").exists()


@pytest.mark.parametrize("finished", [True, False])
def test_a_folder_of_another_config_is_refused_naming_the_values(finished, tmp_path):
    generate_dataset(small_config(), tmp_path, workers=1, progress=False)
    if not finished:
        text = (tmp_path / "manifest.json").read_text()
        (tmp_path / "manifest.json").unlink()
        (tmp_path / "request.json").write_text(text)
    before = contents(tmp_path)
    config = small_config()
    config.seed, config.pose.group = 7, PoseGroup.so3
    with pytest.raises(
        ShardError, match=r"(?s)  pose\.group: folder has track, asked for so3.*\n  seed: folder has 2023, asked for 7"
    ):
        generate_dataset(config, tmp_path, workers=1, progress=False)
    assert contents(tmp_path) == before


def test_a_folder_with_strange_shards_is_refused(tmp_path):
    (tmp_path / "train-00099.safetensors").write_bytes(b"?")
    with pytest.raises(ShardError, match=r"train-00099\.safetensors is no shard"):
        generate_dataset(small_config(), tmp_path, workers=1, progress=False)


def test_two_runs_never_write_into_one_folder(tmp_path):
    with sole_writer(tmp_path), pytest.raises(FolderInUseError, match="another process"):
        generate_dataset(small_config(), tmp_path, workers=1, progress=False)


def test_no_room_is_said_before_anything_is_written(tmp_path, monkeypatch):
    monkeypatch.setattr(shutil, "disk_usage", lambda path: SimpleNamespace(free=500_000))
    with pytest.raises(DiskFullError, match=r"about \d\.\d MB to write, 0\.5 MB free"):
        generate_dataset(small_config(), tmp_path, workers=1, progress=False)
    assert not contents(tmp_path)


@pytest.mark.parametrize("workers", [1, 2])
def test_disk_full_while_writing_leaves_nothing_half_written(workers, uninterrupted, tmp_path):
    config = small_config(210, 42, 7)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    largest = max(len(data) for name, data in uninterrupted.items() if name.endswith(".safetensors"))
    resource.setrlimit(resource.RLIMIT_FSIZE, (largest - 1, hard))
    try:
        with pytest.raises(DiskFullError, match=r"no room for .*\.safetensors.*finished files are kept"):
            generate_dataset(config, tmp_path, workers=workers, progress=False)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    left = contents(tmp_path)
    assert "manifest.json" not in left
    assert {name for name in left if name.endswith(".safetensors")} <= uninterrupted.keys()
    assert all(uninterrupted[name] == data for name, data in left.items() if name.endswith(".safetensors"))
    generate_dataset(config, tmp_path, workers=1, progress=False)
    assert contents(tmp_path) == uninterrupted
