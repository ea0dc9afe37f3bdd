"""The study on real objects, on two small meshes made here: a house with one mirror plane, a wedge with none."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from experiments.real_objects import objects, report, study, truth
from experiments.real_objects.conditions import CONDITIONS, make
from experiments.real_objects.meshes import DIAGONAL, MeshSurface, listed
from experiments.real_objects.scores import score
from experiments.real_objects.truth import to_triangles, true_planes
from symshrec.planes import Planes

CUBE = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
FACES = np.array([each for a, b, c, d in QUADS for each in ((a, b, c), (a, c, d))])


def block(size, at, slant=0.0) -> np.ndarray:
    """Triangles of a box whose top leans by `slant` in y."""
    corners = CUBE * size
    corners[:, 1] += slant * corners[:, 2]
    return (corners + at)[FACES]


HOUSE = np.concatenate([block((2, 1, 1), (3, 4, 5)), block((0.5, 0.5, 1), (3.75, 4, 6), slant=0.4)])  # mirrors at x = 4
WEDGE = np.concatenate([block((2, 1, 0.6), (0, 0, 0), slant=0.7), block((0.3, 1.3, 1.1), (0.1, 0.2, 0.6), slant=-0.3)])


@pytest.fixture(scope="module", autouse=True)
def quicker():
    """A coarser search, enough for meshes of a few triangles."""
    with pytest.MonkeyPatch.context() as patch:
        for name, value in (("DENSE", 40_000), ("DIRECTIONS", 400), ("JUDGED", 2000)):
            patch.setattr(truth, name, value)
        yield


@pytest.fixture(scope="module")
def packages(tmp_path_factory):
    """A folder of packages with the two meshes, and a list of them without their planes."""
    folder = tmp_path_factory.mktemp("packages")
    rows = []
    for name, triangles in (("house", HOUSE), ("wedge", WEDGE)):
        lines = [f"v {x} {y} {z}" for x, y, z in triangles.reshape(-1, 3)]
        lines += [f"f {i} {i + 1} {i + 2}" for i in range(1, len(lines), 3)]
        (folder / f"{name}.obj").write_text("\n".join(lines) + "\n")
        rows.append({"name": name, "what": "made here", "package": "none", "file": f"{name}.obj", "up": "y"})
    (folder / "objects.json").write_text(json.dumps({"packages": {}, "objects": rows}))
    objects.find_truth(folder, ["house", "wedge"], folder / "objects.json")
    return folder


def test_the_truth_is_the_plane_that_the_mesh_was_made_with(packages):
    house, wedge = listed(packages / "objects.json")["objects"]
    assert len(house["planes"]) == 1
    assert wedge["planes"] == wedge["nearly"] == []
    normal, point = np.array(house["planes"][0][:3]), np.array(house["planes"][0][3:6])
    assert abs(normal[0]) > np.cos(np.radians(0.1))
    assert abs((np.array([4.0, 4.5, 6.0]) - point) @ normal) < 0.002 * np.linalg.norm(np.ptp(HOUSE, axis=(0, 1)))


def test_a_hexagonal_prism_has_seven_planes():
    turns = np.arange(6) * np.pi / 3
    ring = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    low, high = (np.column_stack([ring, np.full(6, z)]) for z in (0.0, 0.7))
    sides = [t for i in range(6) for t in ((low[i], low[i - 5], high[i]), (low[i - 5], high[i - 5], high[i]))]
    caps = [(part[0], part[i], part[i + 1]) for part in (low, high) for i in range(1, 5)]
    exact, _ = true_planes(np.array(sides + caps))
    assert len(exact) == 7


def test_distance_to_triangles_is_that_to_the_nearest_of_many_points_on_them():
    rng = np.random.default_rng(0)
    triangle, points = rng.normal(size=(1, 3, 3)), rng.normal(size=(50, 3)) * 2
    surface = MeshSurface(triangle)
    dense = surface.points(surface.draw(100_000, rng))
    expected = cKDTree(dense).query(points)[0]
    np.testing.assert_allclose(to_triangles(points, np.repeat(triangle, 50, axis=0)), expected, atol=0.03)


@pytest.mark.parametrize("name", list(CONDITIONS))
def test_a_condition_leaves_the_true_plane_where_it_was(packages, name):
    """Mirrored across the true plane, what is left of the object lies on the object, but where it is bent across."""
    shape = objects.load(listed(packages / "objects.json")["objects"][0], packages)
    cloud = make(shape.surface, shape.planes, shape.nearly, shape.name, name)
    again = make(shape.surface, shape.planes, shape.nearly, shape.name, name)
    assert np.array_equal(cloud.points, again.points)
    assert len(cloud.true) == 1
    upright = cloud.points @ cloud.turn
    plane = cloud.true.transformed(cloud.turn.T)
    assert np.linalg.norm(plane.points) < 0.01 * DIAGONAL  # P15 bends from there
    np.testing.assert_allclose(np.abs(plane.normals), np.abs(shape.planes.normals), atol=1e-9)
    tree = cKDTree(shape.surface.points(shape.surface.draw(40_000, np.random.default_rng(1))))
    on = np.median(tree.query(plane.mirror(upright)[0])[0]) / DIAGONAL
    noisy = name in ("P7", "noise_3", "noise_2", "P14", "floor_2", "floor_4", "P15", "bend_4")
    assert on < (1.0 if noisy else 0.02)


def test_directions_are_those_named(packages):
    """One side cut away is the side of the plane; a density step lies in it."""
    shape = objects.load(listed(packages / "objects.json")["objects"][0], packages)
    cut = make(shape.surface, shape.planes, shape.nearly, shape.name, "side_cut_15")
    heights = cut.points @ cut.true.normals[0] - cut.true.offsets[0]
    assert min(heights.max(), -heights.min()) < 0.8 * max(heights.max(), -heights.min())
    step = make(shape.surface, shape.planes, shape.nearly, shape.name, "step_3")
    denser = (step.points @ step.true.normals[0] > step.true.offsets[0]).mean()
    assert max(denser, 1 - denser) == pytest.approx(0.75, abs=0.02)


def test_score_of_planes_right_near_and_false():
    true = Planes(np.eye(3)[:2], np.zeros((2, 3)))
    shift = np.array([[0.005 * DIAGONAL, 0, 0], [0, 0.015 * DIAGONAL, 0], [0, 0, 0.5]])
    found = Planes(np.eye(3), shift, [0.9, 0.8, 0.7])
    assert score(found, true, Planes.empty()) == (0.5, 1.0, 1)
    assert score(found, true, Planes([[0, 0, -1]], [[0, 0, 0.5]])).false == 0
    unsure = replace(found, confidences=np.array([0.4, 0.8, 0.3]))
    assert score(unsure, true, Planes.empty()) == (0.0, 0.0, 0)
    assert np.isnan(score(found, Planes.empty(), true).found)


def test_a_killed_study_goes_on_where_it_was(packages, tmp_path, capsys):
    """A line cut short is made again, the others are not; the page has a figure for each."""
    table = listed(packages / "objects.json")
    ask = (table["objects"], ["P0", "points_300"], ["pca_icp"], tmp_path, packages)
    study.study(*ask)
    path = tmp_path / "pca_icp" / study.ROWS
    first = path.read_text()
    assert first.count("\n") == 4
    path.write_text(first[:-40])
    study.study(*ask)
    kept, remade = first.splitlines()[:3], path.read_text().splitlines()
    assert remade[:3] == kept
    assert len(remade) == 4
    assert [row.object for row in study.stored(tmp_path, "pca_icp")] == ["house", "house", "wedge", "wedge"]
    report.write(table["objects"], {}, tmp_path, tmp_path / "real.md")
    page = (tmp_path / "real.md").read_text()
    assert "1 objects with exact mirror planes and 1 without" in page
    found = [row for row in page.splitlines() if row.startswith("| P0 as it is")]
    assert found[0].split("|")[2].strip() == "1.00"


def test_another_file_is_refused(packages):
    row = dict(listed(packages / "objects.json")["objects"][0], sha256="0" * 64)
    with pytest.raises(ValueError, match=r"house\.obj is not the file .*--truth"):
        objects.load(row, packages)
    with pytest.raises(ValueError, match=r"gone\.obj is missing; install"):
        objects.load(dict(row, file="gone.obj"), packages)
