"""`symshrec view`: which points and planes it opens, and what it says where it cannot."""

import numpy as np
import pytest

from symshrec.benchmark.official import write_planes, write_points, write_results, write_track
from symshrec.benchmark.shards import ShardedSplit
from symshrec.cli import main
from symshrec.cli.view import open_scene
from symshrec.files.predictions import save_predictions
from symshrec.planes import PackedPlanes, Planes
from symshrec.reporting.figures import viewer

GUESS = Planes([[0, 0, 1], [0, 1, 0]], np.zeros((2, 3)), [0.75, 0.5])


@pytest.fixture
def predictions(shards, tmp_path):
    """Predictions of the first five test clouds."""
    path = tmp_path / "predictions.safetensors"
    save_predictions(path, range(5), range(5), PackedPlanes.pack([GUESS] * 5), {})
    return path


def test_shards_and_official_folders_show_the_same_cloud(shards, predictions, tmp_path):
    cloud = ShardedSplit(shards, "test")[3]
    write_track([cloud], tmp_path / "track")
    from_shards = open_scene(shards, 3, None, predictions)
    np.testing.assert_array_equal(from_shards.points, cloud.points)
    np.testing.assert_array_equal(from_shards.planes.normals, cloud.planes.normals)
    np.testing.assert_array_equal(from_shards.predicted.confidences, GUESS.confidences)
    from_text = open_scene(tmp_path / "track", None, None, None)
    np.testing.assert_allclose(from_text.points, cloud.points, atol=1e-6)
    np.testing.assert_allclose(from_text.planes.normals, cloud.planes.normals, atol=1e-11)
    assert from_text.predicted is None
    assert open_scene(shards, 2, "train", None).name == "train-000002"
    assert open_scene(shards, None, None, None).name == "test-000000"


def test_a_file_shows_its_points_and_the_planes_beside_it(tmp_path):
    points = np.random.default_rng(0).normal(size=(30, 3)).round(3)
    write_points(tmp_path / "points7.txt", points)
    scene = open_scene(tmp_path / "points7.txt", None, None, None)
    np.testing.assert_array_equal(scene.points, points)
    assert scene.planes is None
    write_planes(tmp_path / "points7_sym.txt", GUESS[[0]])
    write_results(tmp_path / "points7_res.txt", GUESS)
    scene = open_scene(tmp_path / "points7.txt", None, None, tmp_path / "points7_res.txt")
    assert len(scene.planes) == 1
    assert scene.predicted.confidences.tolist() == [0.75, 0.5]


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        (["{shards}", "18"], "there is no cloud 18"),
        (["{shards}", "--split", "valid"], "no split 'valid'"),
        (["{shards}", "7", "--predictions", "{predictions}"], "holds nothing for cloud 7"),
        (["{shards}", "1", "--predictions", "gone.safetensors"], "gone.safetensors"),
        (["{predictions}", "3"], "is one file; an ID or --split is for a folder"),
        (["{predictions}"], "unknown extension '.safetensors'"),
        (["gone.ply"], "gone.ply"),
    ],
)
def test_what_is_not_there_is_told_in_one_line(arguments, problem, shards, predictions, monkeypatch, capsys):
    monkeypatch.setattr(viewer, "require_window", lambda: None)
    assert main(["view", *(each.format(shards=shards, predictions=predictions) for each in arguments)]) == 2
    told = capsys.readouterr().err
    assert problem in told
    assert told.count("\n") == 1


def test_a_missing_viewer_or_screen_is_told_before_anything_is_read(monkeypatch, capsys):
    monkeypatch.setattr(viewer, "find_spec", lambda name: None)
    assert main(["view", "gone.ply"]) == 2
    assert "pip install 'symshrec[view]'" in capsys.readouterr().err
    monkeypatch.setattr(viewer, "find_spec", lambda name: True)
    monkeypatch.setattr(viewer.sys, "platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    assert main(["view", "gone.ply"]) == 2
    assert capsys.readouterr().err.startswith("symshrec view: there is no screen here")


def test_the_window_gets_the_cloud_and_every_plane(shards, monkeypatch):
    polyscope = pytest.importorskip("polyscope")
    polyscope.set_allow_headless_backends(True)
    polyscope.set_use_prefs_file(False)
    polyscope.init("openGL_mock")
    cloud = ShardedSplit(shards, "test")[0]
    viewer.register(viewer.Scene("cloud", cloud.points, cloud.planes, GUESS))
    assert polyscope.get_point_cloud("cloud").n_points() == len(cloud.points)
    names = [f"true plane {number + 1}" for number in range(len(cloud.planes))]
    for name in [*names, "predicted plane 1, confidence 0.75", "predicted plane 2, confidence 0.50"]:
        assert polyscope.get_surface_mesh(name).n_faces() >= 1
    polyscope.remove_all_structures()
    viewer.register(viewer.Scene("alone", cloud.points))
    assert not polyscope.has_surface_mesh("true plane 1")


def test_a_survey_is_drawn_about_its_own_centre(tmp_path, monkeypatch):
    points = np.random.default_rng(0).normal(size=(30, 3)).round(3)
    far = np.array([456_789.0, 5_123_456.0, 312.0])
    np.savetxt(tmp_path / "a.csv", points + far, delimiter=";")
    write_planes(tmp_path / "a_sym.txt", Planes(GUESS.normals, np.tile(far, (2, 1))))
    shown = []
    monkeypatch.setattr(viewer, "require_window", lambda: None)
    monkeypatch.setattr(viewer, "show", shown.append)
    assert main(["view", str(tmp_path / "a.csv")]) == 0
    (scene,) = shown
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    np.testing.assert_allclose(scene.points, points - middle, atol=1e-6)
    np.testing.assert_allclose(scene.planes.offsets, GUESS.normals @ -middle, atol=1e-6)
    assert (scene.predicted, scene.name) == (None, "a.csv")
