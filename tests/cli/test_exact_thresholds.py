"""§2.3 A prediction exactly at the tolerance matches, at the diagonal that the organisers' script computes."""

import numpy as np
import pytest

from symshrec.benchmark.official import OfficialFolder
from symshrec.cli.score import score
from symshrec.cli.sources import open_results, open_truth
from symshrec.data.datamodule import collate

EPSILON = 0.01
CLOUDS = 400


def organisers_hit(points_file, truth_file, result_file):
    """Whether the only prediction matches the only true plane: their steps, all in float64."""
    points = np.loadtxt(points_file)
    diagonal = np.linalg.norm(points.max(axis=0) - points.min(axis=0))
    true, predicted = (np.loadtxt(file, skiprows=1) for file in (truth_file, result_file))
    angular = 1 - abs(np.dot(true[:3], predicted[:3]))
    offset = abs(np.dot(true[:3], predicted[3:6]) - np.dot(true[:3], true[3:6]))
    return angular <= 1 - np.cos(np.radians(1)) and offset <= EPSILON * diagonal


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Clouds with the true plane x = 0 and one prediction beside it, at the tolerance or the next number from it."""
    folder, rng = tmp_path_factory.mktemp("exact"), np.random.default_rng(0)
    for cloud in range(CLOUDS):
        stem = folder / f"points{cloud}"
        np.savetxt(f"{stem}.txt", rng.uniform(-2, 2, (9, 3)), fmt="%.6f")
        points = np.loadtxt(f"{stem}.txt")
        limit = EPSILON * np.linalg.norm(points.max(axis=0) - points.min(axis=0))
        place = limit if cloud % 2 else np.nextafter(limit, np.inf)
        for name, numbers in (("sym", "1 0 0 0 0 0"), ("res", f"1 0 0 {float(place)!r} 0 0 1")):
            (folder / f"points{cloud}_{name}.txt").write_text(f"1\n{numbers}\n")
    return folder


def test_matches_are_the_organisers(folder):
    stems = [f"{folder}/points{cloud}" for cloud in range(CLOUDS)]
    expected = [organisers_hit(f"{stem}.txt", f"{stem}_sym.txt", f"{stem}_res.txt") for stem in stems]
    assert expected == [bool(cloud % 2) for cloud in range(CLOUDS)]
    truth = open_truth(folder, None, None, None)
    scores = score(open_results(folder), truth, 1.0, EPSILON, -np.inf, workers=1).scores
    found = scores.phc.reshape(-1)
    differing = np.flatnonzero(found != expected)
    assert not len(differing), f"{len(differing)} of {CLOUDS} differ from the organisers'"


def test_batches_carry_the_same_diagonals(folder):
    clouds = OfficialFolder(folder)
    batch = collate([(position, clouds[position], None) for position in range(20)])
    assert str(batch.points.dtype) == "torch.float32"
    for position in range(20):
        points = np.loadtxt(folder / f"points{position}.txt")
        assert float(batch.diagonals[position]) == np.linalg.norm(points.max(axis=0) - points.min(axis=0))
