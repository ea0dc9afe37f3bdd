"""`symshrec export`: shards and predictions as text files, refused, taken up again and overwritten."""

import json
import shutil

import numpy as np
import pytest

from symshrec.benchmark.official import OfficialFolder, ResultsFolder
from symshrec.benchmark.shards import ShardedSplit
from symshrec.cli import export, main
from symshrec.files.predictions import save_predictions
from symshrec.planes import PackedPlanes, Planes


def exported(*arguments) -> int:
    return main(["export", *map(str, arguments), "--workers", "1"])


@pytest.mark.parametrize("layout", ["track", "symmetria"])
def test_shards_come_back_from_either_layout(layout, shards, tmp_path):
    assert exported(shards, tmp_path / "out", "--format", layout) == 0
    for split in ("train", "test"):
        ours, theirs = ShardedSplit(shards, split), OfficialFolder(tmp_path / "out", split=split)
        assert len(ours) == len(theirs)
        assert [theirs[position].id for position in range(len(theirs))] == list(range(len(ours)))
        for position in range(len(ours)):
            cloud, read = ours[position], theirs[position]
            np.testing.assert_array_equal(read.points, np.round(cloud.points.astype(float), 6))
            np.testing.assert_allclose(read.planes.normals, cloud.planes.normals, rtol=0, atol=1e-12)
            np.testing.assert_allclose(read.planes.points, cloud.planes.points, rtol=0, atol=1e-12)
        if layout == "symmetria":
            assert theirs.families.tolist() == ours.families.tolist()
            assert theirs.perturbations.tolist() == ours.perturbations.tolist()
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == (
        ["benchmark-test", "benchmark-train"] if layout == "track" else ["test", "train"]
    )


def test_one_split_alone(shards, tmp_path):
    assert exported(shards, tmp_path / "out", "--split", "train") == 0
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["benchmark-train"]


def test_predictions_become_results_to_the_bit_of_their_confidence(tmp_path):
    rng = np.random.default_rng(0)
    planes = [Planes(rng.normal(size=(k, 3)), rng.normal(size=(k, 3)), rng.random(k)) for k in (3, 0, 2)]
    save_predictions(tmp_path / "predictions.safetensors", [0, 1, 2], [7, 8, 12], PackedPlanes.pack(planes), {})
    assert exported(tmp_path / "predictions.safetensors", tmp_path / "out") == 0
    results = ResultsFolder(tmp_path / "out")
    assert results.ids == [7, 8, 12]
    assert len(list((tmp_path / "out").iterdir())) == 3
    for cloud, ours in zip(results.ids, planes, strict=True):
        np.testing.assert_array_equal(results.get(cloud).confidences, ours.confidences)
        np.testing.assert_allclose(results.get(cloud).normals, ours.normals, rtol=0, atol=1e-12)


def test_an_interrupted_export_goes_on_where_it_was(shards, tmp_path, monkeypatch, capsys):
    out, write = tmp_path / "out", export._write_cloud
    whole = tmp_path / "whole"
    assert exported(shards, whole) == 0

    def interrupted(clouds, layout, folder, position):
        if position == 10:
            raise KeyboardInterrupt
        write(clouds, layout, folder, position)

    with monkeypatch.context() as patch:
        patch.setattr(export, "_write_cloud", interrupted)
        assert exported(shards, out) == 130
    first = out / "benchmark-test" / "points3.txt"
    before = first.stat().st_mtime_ns
    (out / "benchmark-test" / ".points11.txt.1.partial").write_text("0 0")
    assert exported(shards, out, "--format", "symmetria") == 2
    assert "is not empty" in capsys.readouterr().err
    assert exported(shards, out) == 0
    assert "going on with the unfinished export" in capsys.readouterr().err
    assert first.stat().st_mtime_ns == before
    files = {path.relative_to(whole): path.read_bytes() for path in whole.rglob("*") if path.is_file()}
    assert {path.relative_to(out): path.read_bytes() for path in out.rglob("*") if path.is_file()} == files


def test_a_folder_in_use_is_refused_or_overwritten_but_for_what_is_not_ours(shards, tmp_path, capsys):
    out = tmp_path / "out"
    assert exported(shards, out) == 0
    stale, notes = out / "benchmark-test" / "points500.txt", out / "benchmark-test" / "notes.txt"
    stale.write_text("0 0 0\n")
    notes.write_text("mine")
    assert exported(shards, out) == 2
    assert "is not empty" in capsys.readouterr().err
    assert stale.exists()
    assert exported(shards, out, "--overwrite") == 0
    assert not stale.exists()
    assert notes.read_text() == "mine"
    assert len(OfficialFolder(out, split="test")) == 18


def test_a_user_error_is_one_line(shards, tmp_path, capsys):
    predictions = tmp_path / "predictions.safetensors"
    save_predictions(predictions, [0], [0], PackedPlanes.pack([Planes.empty()]), {})
    (tmp_path / "text").write_text("no predictions")
    twins = tmp_path / "twins.safetensors"
    save_predictions(twins, [0, 1], [4, 4], PackedPlanes.pack([Planes.empty()] * 2), {})
    for arguments, problem in (
        ([tmp_path / "nowhere", tmp_path / "out"], "nowhere"),
        ([shards, tmp_path / "out", "--split", "valid"], "no split 'valid'"),
        ([predictions, tmp_path / "out", "--split", "test"], "--split and --format are for shards"),
        ([tmp_path / "text", tmp_path / "out"], "text"),
        ([twins, tmp_path / "out"], "ID 4 is of several clouds"),
    ):
        assert exported(*arguments) == 2
        told = capsys.readouterr().err
        assert told.startswith("symshrec export: ")
        assert problem in told
        assert told.count("\n") == 1
        assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", ["../outside", "/outside", "a/b", "..", "out side", "{0}"])
def test_no_split_in_a_manifest_leaves_the_folder(name, shards, tmp_path, capsys):
    name = f"{tmp_path}{name}" if name.startswith("/") else name
    outside = tmp_path / "benchmark-outside"
    outside.mkdir()
    (outside / "points0.txt").write_text("mine")
    refused = exported(_forged(shards, tmp_path, '"train"', json.dumps(name)), tmp_path / "out", "--overwrite")
    told = capsys.readouterr().err
    assert (refused, told.count("\n")) == (2, 1)
    assert "a split's name consists of" in told
    assert sorted(each.name for each in tmp_path.iterdir()) == ["benchmark-outside", "forged"]
    assert (outside / "points0.txt").read_text() == "mine"


@pytest.mark.parametrize("name", ["../x.safetensors", "/x.safetensors", "a\\b.safetensors", "x.txt", "a\0.safetensors"])
def test_no_shard_in_a_manifest_is_outside_its_folder(name, shards, tmp_path, capsys):
    forged = _forged(shards, tmp_path, '"train-00000.safetensors"', json.dumps(name))
    (forged / "train-00000.safetensors").rename(tmp_path / "x.safetensors")
    assert exported(forged, tmp_path / "out") == 2
    assert "without a folder" in capsys.readouterr().err


def _forged(shards, tmp_path, old, new):
    forged = tmp_path / "forged"
    shutil.copytree(shards, forged)
    text = (forged / "manifest.json").read_text()
    (forged / "manifest.json").write_text(text.replace(old, new))
    return forged
