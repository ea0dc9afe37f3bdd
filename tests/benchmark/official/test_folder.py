"""Folders of the track and of its successor: what is in them, and what must not be."""

import lzma
import pickle
import resource
from itertools import product

import numpy as np
import pytest

from symshrec.benchmark.cloud import FAMILIES, PERTURBATIONS, UNKNOWN, Labels
from symshrec.benchmark.official import (
    OfficialFileError,
    OfficialFolder,
    ResultsFolder,
    read_planes,
    write_results,
    write_symmetria,
    write_track,
)
from symshrec.benchmark.official.symmetria import read_compressed_points
from symshrec.planes import Planes


def assert_same_planes(ours: Planes, theirs: Planes, tolerance: float):
    np.testing.assert_allclose(ours.normals, theirs.normals, rtol=0, atol=tolerance)
    np.testing.assert_allclose(ours.points, theirs.points, rtol=0, atol=tolerance)


@pytest.mark.parametrize("write", [write_track, write_symmetria])
def test_a_folder_gives_back_the_clouds_written_to_it(write, random_cloud, tmp_path):
    rng = np.random.default_rng(1)
    labels = [Labels(family, "cone", code) for family, code in product((*FAMILIES, UNKNOWN), (*PERTURBATIONS, UNKNOWN))]
    clouds = [random_cloud(rng, 3 * place, each) for place, each in enumerate(labels)]
    write(reversed(clouds), tmp_path)
    folder = pickle.loads(pickle.dumps(OfficialFolder(tmp_path)))
    assert len(folder) == len(clouds)
    assert folder.ids.tolist() == [cloud.id for cloud in clouds]
    for position, cloud in enumerate(clouds):
        read = folder[position]
        assert read.id == cloud.id
        assert read.points.dtype == np.float64
        np.testing.assert_allclose(read.points, cloud.points, rtol=0, atol=1e-6)
        assert_same_planes(read.planes, cloud.planes, 1e-12)
    known = write is write_symmetria
    assert folder.families.tolist() == [each.family if known else UNKNOWN for each in labels]
    assert folder.perturbations.tolist() == [each.perturbation if known else UNKNOWN for each in labels]
    again = tmp_path / "again"
    write((folder[position] for position in range(len(folder))), again)
    for path in again.rglob("*.*"):
        assert path.read_bytes() == (tmp_path / path.relative_to(again)).read_bytes()


def test_the_successors_names_and_axes(tmp_path):
    points = lzma.compress(b"0.0 0.0 0.0\n1.0 1.0 1.0\n")
    names = ["000012-lemniscate-Undersampling+Uniform", "000002-EggKeplero-gaussian", "000100-revolution-clean"]
    for name in names:
        (tmp_path / f"{name}.xz").write_bytes(points)
        text = "3\naxis 0 0 1 0 0 0 inf\nplane 0 0 1 0.5 0.25 0\naxis 0 0 1 0 0 0 3.14\n"
        (tmp_path / f"{name}-sym.txt").write_text(text)
    folder = OfficialFolder(tmp_path)
    assert folder.names.tolist() == [names[1], names[0], names[2]]
    assert folder.families.tolist() == ["egg_keplero", "lemniscate_bernoulli", UNKNOWN]
    assert folder.perturbations.tolist() == ["P2", "P4", "P0"]
    assert_same_planes(folder[0].planes, Planes([[0, 0, 1]], [[0.5, 0.25, 0]]), 0)


def test_splits_are_found_below_a_root_and_never_mistaken(random_cloud, tmp_path):
    rng = np.random.default_rng(2)
    write_track([random_cloud(rng, 1)], tmp_path / "benchmark-train")
    write_track([random_cloud(rng, 2), random_cloud(rng, 3)], tmp_path / "benchmark-test")
    assert OfficialFolder(tmp_path, split="train").ids.tolist() == [1]
    assert OfficialFolder(tmp_path, split="test").ids.tolist() == [2, 3]
    assert OfficialFolder(tmp_path / "benchmark-test", split="test").ids.tolist() == [2, 3]
    with pytest.raises(OfficialFileError, match="several splits, train, test"):
        OfficialFolder(tmp_path)
    with pytest.raises(OfficialFileError, match="no split 'train', only benchmark-test"):
        OfficialFolder(tmp_path / "benchmark-test", split="train")
    with pytest.raises(OfficialFileError, match="no split 'valid', only benchmark-train, benchmark-test"):
        OfficialFolder(tmp_path, split="valid")


def test_subsets_withheld_truth_and_points_elsewhere(random_cloud, tmp_path):
    rng = np.random.default_rng(3)
    root, points, subset = tmp_path / "truth", tmp_path / "points", tmp_path / "subset.txt"
    write_track([random_cloud(rng, cloud) for cloud in (10, 9, 100)], root)
    subset.write_text("100\n9\n")
    assert OfficialFolder(root, subset=subset).ids.tolist() == [9, 100]
    assert OfficialFolder(root, subset=[10]).ids.tolist() == [10]
    before = OfficialFolder(root).fingerprint
    points.mkdir()
    for cloud in (9, 10, 100):
        (root / f"points{cloud}.txt").rename(points / f"points{cloud}.txt")
    withheld = OfficialFolder(points)
    assert not withheld.has_truth
    assert withheld[0].planes is None
    assert withheld.fingerprint != before
    assert len(OfficialFolder(root, points=points)[1].planes) == len(read_planes(root / "points10_sym.txt"))
    subset.write_text("100\n11\n")
    with pytest.raises(OfficialFileError, match=r"subset\.txt:2: there is no cloud 11"):
        OfficialFolder(points, subset=subset)


def test_a_missing_partner_a_double_and_an_empty_folder_are_refused(random_cloud, tmp_path):
    rng = np.random.default_rng(4)
    write_track([random_cloud(rng, 1), random_cloud(rng, 2)], tmp_path)
    (tmp_path / "points1_sym.txt").unlink()
    with pytest.raises(OfficialFileError, match=r"points1\.txt: its truth, points1_sym\.txt, is missing"):
        OfficialFolder(tmp_path)
    write_track([random_cloud(rng, 1)], tmp_path)
    (tmp_path / "points2.txt").rename(tmp_path / "points01.txt")
    with pytest.raises(OfficialFileError, match=r"points1\.txt: .*points01\.txt is of the same cloud"):
        OfficialFolder(tmp_path)
    (tmp_path / "points01.txt").unlink()
    with pytest.raises(OfficialFileError, match=r"points2_sym\.txt: its points, points2\.txt, are missing"):
        OfficialFolder(tmp_path)
    (tmp_path / "empty").mkdir()
    for opened in (OfficialFolder, ResultsFolder):
        for name in ("empty", "nowhere"):
            with pytest.raises(OfficialFileError, match=f"{name}: there is no"):
                opened(tmp_path / name)


def test_a_results_folder_reads_by_id_and_refuses_doubles(random_planes, tmp_path):
    planes = random_planes(np.random.default_rng(5), 4)
    write_results(tmp_path / "points12_res.txt", planes)
    write_results(tmp_path / "points3_res.txt", Planes.empty())
    (tmp_path / "notes.txt").write_text("not a result")
    results = ResultsFolder(tmp_path)
    assert results.ids == [3, 12]
    assert results.get(4) is None
    assert len(results.get(3)) == 0
    assert_same_planes(results.get(12), planes, 1e-12)
    write_results(tmp_path / "points012_res.txt", planes)
    with pytest.raises(OfficialFileError, match=r"points12_res\.txt: points012_res\.txt is of the same cloud"):
        ResultsFolder(tmp_path)


def test_errors_within_compressed_points_name_the_line(tmp_path):
    (tmp_path / "1-citrus-clean.xz").write_bytes(lzma.compress(b"0 0 0\n0 0\n"))
    with pytest.raises(OfficialFileError, match=r"1-citrus-clean\.xz:2: 2 columns"):
        OfficialFolder(tmp_path)[0]


def test_compressed_points_are_unpacked_no_further_than_a_cloud_can_be(tmp_path, monkeypatch):
    path = tmp_path / "1-citrus-clean.xz"
    path.write_bytes(lzma.compress(b"0.0 0.0 0.0\n", preset=1) + lzma.compress(b"1.0 0.0 0.0\n") + bytes(8))
    assert read_compressed_points(path).tolist() == [[0, 0, 0], [1, 0, 0]]
    compressor = lzma.LZMACompressor(preset=1)
    million = b"0.000000 0.000000 0.000000\n" * 40_000
    path.write_bytes(b"".join(compressor.compress(million) for _ in range(200)) + compressor.flush())
    assert path.stat().st_size < 100_000
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(OfficialFileError, match=r"clean\.xz:1: the file unpacks to more than 100 MB"):
        OfficialFolder(tmp_path)[0]
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 400_000  # kB
    filters = [{"id": lzma.FILTER_LZMA2, "dict_size": 1 << 29}]
    path.write_bytes(lzma.compress(b"0 0 0\n", filters=filters))
    with pytest.raises(OfficialFileError, match="does not unpack"):
        OfficialFolder(tmp_path)[0]


@pytest.mark.parametrize("name", ["points{}.txt", "{}-citrus-clean.xz", "points{}_res.txt"])
def test_an_id_that_no_array_holds_is_refused(name, tmp_path):
    path = tmp_path / name.format("9" * 20)
    path.write_bytes(b"0\n")
    with pytest.raises(OfficialFileError, match=f"{path.name}: the ID 9+ is too large"):
        (ResultsFolder if "_res" in name else OfficialFolder)(tmp_path)
    path.rename(tmp_path / name.format("0" * 20 + "7"))
    assert list((ResultsFolder if "_res" in name else OfficialFolder)(tmp_path).ids) == [7]


def test_digits_of_other_scripts_name_no_cloud(tmp_path):
    (tmp_path / "points\u0663_res.txt").write_text("0\n")
    (tmp_path / "points\u0663.txt").write_text("0 0 0\n")
    for opened in (OfficialFolder, ResultsFolder):
        with pytest.raises(OfficialFileError, match="there is no"):
            opened(tmp_path)


@pytest.mark.parametrize("split", ["../elsewhere", "/tmp", "a/b", "..", ""])
def test_a_split_is_a_name_and_no_path(split, tmp_path):
    with pytest.raises(OfficialFileError, match="is no name of a folder"):
        OfficialFolder(tmp_path, split=split)
