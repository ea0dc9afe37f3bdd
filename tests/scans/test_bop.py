"""`detect --bop`: BOP's models_info.json, read again as the benchmark's own toolkit reads it."""

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from symshrec import api
from symshrec.cli import main
from symshrec.geometry.rotations import uniform_rotation
from symshrec.planes import Planes

POSE, PLACE = uniform_rotation(np.random.default_rng(7)), np.array([40.0, -8, 300])
SOLIDS = trimesh.creation


def around(degrees):
    angles = np.radians(degrees)
    return np.stack([np.cos(angles), np.sin(angles), 0 * angles], 1)


SIX = np.vstack([around(30 * np.arange(6)), [0, 0, 1]])
MANY = np.vstack([around(np.linspace(0, 13, 16) ** 2), [0, 0, 1]])


@pytest.fixture
def detect(tmp_path, monkeypatch):
    """Writes a mesh in its pose and runs `detect --bop` on it, with planes of known normals."""
    monkeypatch.chdir(tmp_path)

    def run(name, mesh, normals, *arguments):
        mesh = mesh.copy()
        mesh.vertices = mesh.vertices @ POSE.T + PLACE
        mesh.export(name)
        known = Planes(normals @ POSE.T, np.tile(PLACE, (len(normals), 1)), np.linspace(0.9, 0.8, len(normals)))
        monkeypatch.setattr(api, "detect", lambda points, **given: known)
        return main(["detect", name, "--samples", "300", "--bop", "models_info.json", *map(str, arguments)])

    return run


def turns(entry, steps=90):
    """All transforms (T, 4, 4) of an entry, every combination, as bop_toolkit's get_symmetry_transformations."""
    discrete = [np.eye(4), *(np.reshape(each, (4, 4)) for each in entry.get("symmetries_discrete", []))]
    all_turns = []
    for axis in entry.get("symmetries_continuous", []):
        for angle in 2 * np.pi * np.arange(steps) / steps:
            turn = np.eye(4)
            turn[:3, :3] = Rotation.from_rotvec(angle * np.array(axis["axis"])).as_matrix()
            turn[:3, 3] = np.array(axis["offset"]) - turn[:3, :3] @ axis["offset"]
            all_turns.append(turn)
    return np.array([one @ other for one in discrete for other in all_turns or [np.eye(4)]])


@pytest.mark.parametrize(
    ("mesh", "normals", "discrete", "continuous"),
    [
        (SOLIDS.box((20, 30, 50)), np.eye(3), 3, 0),
        (SOLIDS.box((20, 30, 50)), np.eye(3)[:2], 1, 0),
        (SOLIDS.cylinder(20, 15, sections=6), SIX, 11, 0),
        (SOLIDS.cylinder(20, 60, sections=90), MANY, 1, 1),
        (SOLIDS.cone(20, 60, sections=90), MANY[:-1], 0, 1),
    ],
    ids=["box", "two planes", "prism", "cylinder", "cone"],
)
def test_every_symmetry_maps_the_model_onto_itself_and_is_a_rotation(mesh, normals, discrete, continuous, detect):
    assert detect("obj_000012.ply", mesh, normals) == 0
    entry = json.loads(Path("models_info.json").read_text())["12"]
    assert len(entry.get("symmetries_discrete", [])) == discrete
    assert len(entry.get("symmetries_continuous", [])) == continuous
    vertices, near = trimesh.load("obj_000012.ply").vertices, 0.75 if continuous else 0.02  # of 1.4 between vertices
    for turn in turns(entry):
        assert np.linalg.det(turn[:3, :3]) == pytest.approx(1, abs=1e-6)
        np.testing.assert_array_equal(turn[3], [0, 0, 0, 1])
        assert cKDTree(vertices).query(vertices @ turn[:3, :3].T + turn[:3, 3])[0].max() < near
    assert len({tuple(np.round(turn, 6).ravel() + 0.0) for turn in turns(entry, 7)}) == len(turns(entry, 7))
    np.testing.assert_allclose([entry[f"min_{axis}"] for axis in "xyz"], vertices.min(axis=0), atol=1e-4)
    far = np.linalg.norm(vertices[:, None] - vertices[None], axis=2).max()
    assert entry["diameter"] == pytest.approx(far, abs=1e-4)


def test_one_plane_gives_no_symmetry_and_says_why(detect, capsys):
    assert detect("cup.ply", SOLIDS.box((20, 30, 50)), np.eye(3)[:1]) == 0
    assert "object 1 has no symmetries: a mirror is no proper rotation" in capsys.readouterr().err
    assert "symmetries_discrete" not in json.loads(Path("models_info.json").read_text())["1"]


def test_an_entry_is_updated_and_the_others_stay(detect, capsys):
    box, path = SOLIDS.box((20, 30, 50)), Path("models_info.json")
    before = {"1": {"diameter": 9.5}, "5": {"diameter": 61.6, "symmetries_continuous": [1], "colour": "red"}}
    path.write_text(json.dumps(before))
    assert detect("obj_000005.ply", box, np.eye(3)) == 0
    assert "object 5 has 3 discrete symmetries; 1 unit of the file is 1 mm" in capsys.readouterr().err
    after = json.loads(path.read_text())
    assert after["1"] == before["1"]
    assert (after["5"]["diameter"], after["5"]["colour"], len(after["5"]["symmetries_discrete"])) == (61.6, "red", 3)
    assert "symmetries_continuous" not in after["5"]
    kept = path.read_bytes()
    assert detect("obj_000005.ply", box, np.eye(3), "--bop-scale", 1000) == 2
    assert "object 5 has a diameter of 61.6 mm there and of 61644.2 mm in this file" in capsys.readouterr().err
    assert path.read_bytes() == kept
    assert detect("m.ply", box, np.eye(3), "--bop-id", 7, "--bop-scale", 1000) == 0
    turn = np.reshape(json.loads(path.read_text())["7"]["symmetries_discrete"][0], (4, 4))
    np.testing.assert_allclose(turn[:3, :3] @ PLACE * 1000 + turn[:3, 3], PLACE * 1000, atol=0.05)


@pytest.mark.parametrize("content", ["{", "[]", '{"1": 3}', '{"1": {"diameter": "x"}}'])
def test_what_is_no_models_info_stays_as_it_is(content, detect, capsys):
    Path("models_info.json").write_text(content)
    assert detect("box.ply", SOLIDS.box((20, 30, 50)), np.eye(3)) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert Path("models_info.json").read_text() == content


def test_a_sphere_is_refused(detect, capsys):
    normals = np.random.default_rng(0).normal(size=(24, 3))
    assert detect("ball.ply", SOLIDS.icosphere(3, 20), normals) == 2
    assert "no field for a sphere" in capsys.readouterr().err
    assert not Path("models_info.json").exists()
