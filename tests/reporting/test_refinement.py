"""Errors before and after refinement, on the true planes that both runs found."""

import csv

import numpy as np
import pytest

from symshrec.benchmark.cloud import Labels
from symshrec.planes import PackedPlanes, Planes
from symshrec.reporting.tables.compared import Compared
from symshrec.reporting.tables.refinement import refinement_errors, write_refinement

EYE, ORIGIN = np.eye(3), np.zeros((3, 3))
DIAGONALS = np.array([2.0, 4.0])


def tilted(degrees, offsets, diagonal):
    """The coordinate planes, each turned by an angle and moved by a share of the diagonal along its own normal."""
    angles = np.radians(degrees)[:, None]
    normals = np.cos(angles) * EYE + np.sin(angles) * np.roll(EYE, 1, axis=1)
    return Planes(normals, EYE * (np.asarray(offsets) * diagonal)[:, None], [0.9, 0.8, 0.7])


def run(name, *planes):
    truth = PackedPlanes.pack([Planes(EYE, ORIGIN)] * 2)
    labels = [Labels("astroid", "cone", perturbation) for perturbation in ("P0", "P2")]
    return Compared(name, PackedPlanes.pack(planes), truth, DIAGONALS, labels)


@pytest.fixture
def runs():
    before = run("M", tilted([1, 2, 3], [0.01, 0.02, 0.03], 2), tilted([4, 4, 8], [0.0, 0.0, 0.0], 4))
    refined = tilted([0.1, 9, 0.3], [0.001, 0, 0.003], 2)[[2, 0, 1]], tilted([0.5, 1, 0], [0.0, 0.02, 0], 4)
    return {"m": before, "m_refine": run("M + refine", *refined), "other": before}


def test_the_same_planes_are_compared(runs):
    errors = refinement_errors(runs["m"], runs["m_refine"])
    np.testing.assert_allclose(errors.angles_deg, [[1, 0.1], [3, 0.3], [4, 0.5], [4, 1]], atol=1e-9)
    np.testing.assert_allclose(errors.offsets, [[0.01, 0.001], [0.03, 0.003], [0, 0], [0, 0.02]], atol=1e-12)
    assert errors.clouds.tolist() == [0, 0, 1, 1]
    assert (errors.lost.tolist(), errors.gained.tolist()) == ([0], [1])


def test_the_page_has_a_row_for_every_perturbation_of_every_pair(runs, tmp_path):
    paths, text = write_refinement(runs, tmp_path, "Data: x.")
    assert sorted(tmp_path.iterdir()) == sorted(paths)
    with (tmp_path / "refinement.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert {row["method"] for row in rows} == {"M + refine"}
    assert [row["group"] for row in rows] == [group for group in ("all", "P0", "P2") for _ in range(4)]
    found = {(row["group"], row["quantity"], row["statistic"]): row for row in rows}
    row = found["all", "angle", "median"]
    assert (row["planes"], row["lost"], row["gained"]) == ("4", "1", "1")
    assert (float(row["before"]), float(row["after"])) == (3.5, 0.4)
    row = found["P0", "offset", "mean"]
    assert (float(row["before"]), float(row["after"])) == (2.0, 0.2)
    assert "**0.4000**" in text
    assert "**1.0000**" not in text.split("P2")[1]  # the mean offset of P2 is worse than before


def test_without_a_pair_nothing_is_written(runs, tmp_path):
    del runs["m"]
    assert write_refinement(runs, tmp_path, "") == ([], "")
    assert not list(tmp_path.iterdir())
