"""`symshrec symmetrise`, `complete` and `align`, and `detect --deviation`: on shapes whose answer is known."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from symshrec import api
from symshrec.cli import main
from symshrec.geometry.rotations import uniform_rotation
from symshrec.methods.base import SymmetryMethod
from symshrec.planes import Planes
from symshrec.scans import read_cloud

POSE = uniform_rotation(np.random.default_rng(4)), np.array([30.0, -7, 2])
UPRIGHT = Planes(np.eye(3)[[2, 0, 1]], np.zeros((3, 3)), [0.9, 0.8, 0.7])  # of the shapes before they are posed


class Known(SymmetryMethod):
    """Finds the planes of the upright shape, wherever it is now."""

    def __init__(self, centre, diagonal):
        super().__init__()
        self.centre, self.diagonal = centre, diagonal

    def detect(self, points):
        moved = UPRIGHT.transformed(*POSE)
        return moved.transformed(translation=-self.centre).transformed(scale=1 / self.diagonal)


@pytest.fixture
def shape(tmp_path, monkeypatch):
    """Writes a mesh or a cloud in the pose, into the working folder, and has its planes found."""
    monkeypatch.chdir(tmp_path)

    def write(name, points, faces=None):
        posed = points @ POSE[0].T + POSE[1]
        if faces is None:
            np.save(name, posed)
        else:
            trimesh.Trimesh(posed, faces, process=False).export(name)
        frame = api.Frame.of(read_cloud(name).points)
        monkeypatch.setattr(api, "named_method", lambda method, **given: Known(frame.centre, frame.diagonal))
        return name

    return write


def upright(path):
    return (read_cloud(path).points - POSE[1]) @ POSE[0]


def sheet(z, count=40):
    """A grid in the plane of a height."""
    x, y = (grid.ravel() for grid in np.meshgrid(*[np.linspace(-1, 1, count)] * 2))
    return np.stack([x, y, np.full_like(x, z)], 1)


@pytest.mark.parametrize("extension", ["ply", "obj", "stl"])
def test_align_brings_the_first_plane_to_x_0_and_the_second_to_y_0(extension, shape, capsys):
    box = trimesh.creation.box((1, 2, 3))
    shape("box.ply", box.vertices, box.faces)
    assert main(["align", "box.ply", f"out.{extension}"]) == 0
    matrix = np.array([line.split() for line in capsys.readouterr().out.splitlines()], dtype=float)
    moved = trimesh.load(f"out.{extension}", process=False)
    assert len(moved.faces) == 12
    np.testing.assert_allclose(np.abs(moved.vertices).max(axis=0), [1.5, 0.5, 1], atol=1e-5)
    posed = trimesh.load("box.ply", process=False).vertices
    if extension == "ply":
        np.testing.assert_allclose(posed @ matrix[:3, :3].T + matrix[:3, 3], moved.vertices, atol=1e-9)
    np.testing.assert_allclose(matrix[:3, :3] @ matrix[:3, :3].T, np.eye(3), atol=1e-9)
    assert main(["align", "box.ply", "made/turned.ply", "--planes", "3", "1"]) == 0
    np.testing.assert_allclose(np.abs(trimesh.load("made/turned.ply").vertices).max(axis=0), [1, 1.5, 0.5], atol=1e-5)


@pytest.mark.parametrize("out", ["out.npy", "out.xyz", "out.ply", "out.obj"])
def test_symmetrise_averages_a_cloud_with_its_mirror_image(out, shape, capsys):
    shape("sheets.npy", np.concatenate([sheet(1.0), sheet(-1.5)]))
    assert main(["symmetrise", "sheets.npy", out, "--planes", "1"]) == 0
    result = upright(out)
    assert len(result) == 3200
    np.testing.assert_allclose(np.abs(result[:, 2]), 1.25, atol=1e-5)
    words = capsys.readouterr().out.split()
    assert words[:3] == ["averaged", "over", "Cs:"]
    diagonal = np.linalg.norm(np.ptp(read_cloud("sheets.npy").points, axis=0))
    assert float(words[6]) == pytest.approx(0.5 / diagonal, rel=1e-3)
    assert float(words[8]) < 1e-5


def test_symmetrise_averages_a_mesh_over_its_group_and_keeps_its_faces(shape, capsys):
    box = trimesh.creation.box((2, 2, 2))
    vertices = box.vertices.copy()
    vertices[np.argmax(vertices.sum(axis=1))] += 0.4
    shape("box.ply", vertices, box.faces)
    assert main(["symmetrise", "box.ply", "out.ply"]) == 0
    assert capsys.readouterr().out.startswith("averaged over D2h: 8 images; asymmetry 0.0")
    result = trimesh.load("out.ply", process=False)
    np.testing.assert_array_equal(result.faces, trimesh.load("box.ply", process=False).faces)
    np.testing.assert_allclose(np.abs((result.vertices - POSE[1]) @ POSE[0]), 1.05, atol=1e-5)


def test_complete_fills_the_missing_side_alone(shape, capsys):
    ball = trimesh.creation.icosphere(4)
    whole = ball.vertices * [1.0, 1.5, 2]
    kept = whole[whole[:, 2] < 0.6]
    shape("cut.npy", kept)
    assert main(["complete", "cut.npy", "out.npy", "--min-support", "0.5"]) == 0
    result = upright("out.npy")
    np.testing.assert_allclose(result[: len(kept)], kept, atol=1e-9)
    np.testing.assert_allclose(((result / [1, 1.5, 2]) ** 2).sum(axis=1), 1, atol=1e-5)
    assert result[len(kept) :, 2].min() > 0.55
    assert len(result) == pytest.approx(len(whole), rel=0.05)  # but for a seam
    assert f"plane 1: {len(result) - len(kept):,} points added to {len(kept):,}" in capsys.readouterr().out
    assert main(["complete", "cut.npy", "again.npy", "--min-support", "1.01"]) == 2
    assert "below --min-support 1.01" in capsys.readouterr().err
    assert not Path("again.npy").exists()


def test_complete_adds_faces_that_look_outwards(shape):
    ball = trimesh.creation.icosphere(4)
    kept = ball.triangles_center[:, 2] < 0.3
    shape("cut.ply", ball.vertices, ball.faces[kept])
    assert main(["complete", "cut.ply", "out.ply", "--min-support", "0.5"]) == 0
    result = trimesh.load("out.ply", process=False)
    np.testing.assert_array_equal(result.faces[: kept.sum()], ball.faces[kept])
    added = trimesh.Trimesh((result.vertices - POSE[1]) @ POSE[0], result.faces[kept.sum() :], process=False)
    assert len(added.faces) == pytest.approx((~kept).sum(), rel=0.1)
    assert ((added.triangles_center * added.face_normals).sum(axis=1) > 0.9).all()


def test_deviation_is_the_signed_distance_from_the_mirror_image(shape, capsys):
    shape("sheets.npy", np.concatenate([sheet(1.0), sheet(-1.5)]))
    assert main(["detect", "sheets.npy", "--deviation", "{stem}.ply"]) == 0
    content = Path("sheets.ply").read_bytes()
    head, _, rows = content.partition(b"end_header\n")
    assert b"property float deviation" in head
    table = np.frombuffer(rows, dtype=[("xyz", "<f8", 3), ("deviation", "<f4")])
    np.testing.assert_allclose(table["xyz"], read_cloud("sheets.npy").points)
    np.testing.assert_allclose(np.abs(table["deviation"]), 0.5, atol=1e-5)
    assert len(read_cloud("sheets.ply").points) == 3200
    assert main(["detect", "sheets.npy", "--deviation", "sheets.ply", "--plane", "9"]) == 2
    assert "--plane 9: 3 planes were found" in capsys.readouterr().err
    assert main(["detect", "sheets.ply", "--deviation", "sheets.ply"]) == 2
    assert "is a file that is read" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["symmetrise", "complete", "align"])
@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        (["box.ply", "box.ply"], "box.ply is the file that is read"),
        (["box.ply", "out.pdf"], "unknown extension '.pdf'; what can be written"),
        (["box.ply", "out.npy"], "cannot hold faces; write .ply, .obj, .stl"),
        (["box.ply", "box.ply/out.ply"], "box.ply/out.ply: no folder box.ply can be made (File exists)"),
        (["gone.ply", "out.ply"], "gone.ply"),
        (["box.ply", "out.ply", "--planes", "4"], "--planes 4: box.ply has 3, numbered from 1"),
        (
            ["box.ply", "out.ply", "--min-confidence", "2"],
            "no mirror plane of confidence 2 or more; nothing is written",
        ),
    ],
)
def test_a_user_error_is_one_line_and_nothing_is_written(command, arguments, problem, shape, capsys):
    box = trimesh.creation.box((1, 2, 3))
    shape("box.ply", box.vertices, box.faces)
    before = Path("box.ply").read_bytes()
    assert main([command, *arguments]) == 2
    told = capsys.readouterr()
    assert problem in told.err
    assert told.err.count("\n") == 1
    assert told.err.startswith(f"symshrec {command}: ")
    assert [each.name for each in Path.cwd().iterdir()] == ["box.ply"]
    assert Path("box.ply").read_bytes() == before
