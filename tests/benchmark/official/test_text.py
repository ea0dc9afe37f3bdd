"""The track's files: exact round trips, and errors that name file and line."""

import numpy as np
import pytest

from symshrec.benchmark.official import (
    OfficialFileError,
    read_planes,
    read_points,
    read_results,
    read_subset,
    write_planes,
    write_points,
    write_results,
)
from symshrec.benchmark.official.numbers import _parse_at_once, _parse_by_line
from symshrec.benchmark.official.symmetria import read_compressed_points, read_symmetries
from symshrec.planes import Planes

PLANE = "0 0 1 0.5 0.25 0"


def assert_same_planes(ours: Planes, theirs: Planes, tolerance: float):
    np.testing.assert_allclose(ours.normals, theirs.normals, rtol=0, atol=tolerance)
    np.testing.assert_allclose(ours.points, theirs.points, rtol=0, atol=tolerance)


@pytest.mark.parametrize("seed", range(20))
def test_what_is_read_is_what_is_printed_and_is_written_as_the_same_text_again(seed, random_planes, tmp_path):
    rng = np.random.default_rng(seed)
    planes, points = random_planes(rng, 30), rng.normal(scale=3, size=(200, 3)).astype(np.float32)
    path, again = tmp_path / "points7.txt", tmp_path / "again.txt"
    for write, read, value in (
        (write_points, read_points, points),
        (write_planes, read_planes, planes),
        (write_results, read_results, planes),
    ):
        write(path, value)
        write(again, read(path))
        assert again.read_bytes() == path.read_bytes()
    lines = [[float(field) for field in line.split()] for line in path.read_text().splitlines()[1:]]
    np.testing.assert_array_equal(read_results(path).points, np.array(lines)[:, 3:6])
    np.testing.assert_array_equal(read_results(path).confidences, planes.confidences)
    assert_same_planes(read_results(path), planes, 1e-12)


def test_points_are_printed_with_six_decimals(tmp_path):
    write_points(tmp_path / "points0.txt", np.array([[0.5, -1.25, 0], [1e-7, -1e-7, 12.3456784]], dtype=np.float32))
    assert (tmp_path / "points0.txt").read_text() == "0.500000 -1.250000 0.000000\n0.000000 -0.000000 12.345678\n"


@pytest.mark.parametrize(
    "text",
    [
        "1.500000 -2.250000 0.000001\n-0.000000 12.000000 -0.100000\n",
        "1.5\t-2 1e-3\r\n+.5  7. -1.5E+2\r\n\r\n \n",
        "0.1 0.2 0.3",
        "123456789.123456 0.000000 -1.000000\n",
        "0.1234567890123456789 1 2\n",
        " 1.0 2.0 3.0 \n4.0 5.0 6.0",
    ],
)
def test_every_notation_reads_as_python_reads_it(text, tmp_path):
    rows = _parse_at_once(text.encode(), 3)
    expected = np.array([[float(field) for field in line.split()] for line in text.split("\n") if line.strip()])
    np.testing.assert_array_equal(rows, expected)
    np.testing.assert_array_equal(np.signbit(rows), np.signbit(expected))
    np.testing.assert_array_equal(_parse_by_line(text.encode(), "x y z", tmp_path, 1), expected)


def test_the_fast_way_accepts_nothing_that_the_slow_one_refuses(tmp_path):
    rng = np.random.default_rng(0)
    pieces = [
        "1.25",
        "-0.50",
        "7",
        "1e3",
        ".5",
        "nan",
        "1_0",
        "1-2",
        "0x1",
        "--1",
        "1.2.3",
        "é",
        "\0",
        "inf",
        "1e999",
        "",
    ]
    gaps = [" ", "\n", "\t", "\r\n", "\n\n", ",", "  "]
    accepted = 0
    for _ in range(3000):
        fields = rng.choice(pieces[:2], (int(rng.integers(1, 4)), 3)).astype(object)
        ends = np.full(fields.shape, [" ", " ", "\n"], dtype=object)
        for cells, others in ((fields, pieces), (ends, gaps)):
            changed = rng.random(cells.shape) < rng.choice([0, 0.3])
            cells[changed] = rng.choice(others, changed.sum())
        text = "".join((fields + ends).ravel()).encode()
        rows = _parse_at_once(text, 3)
        if rows is not None:
            accepted += 1
            np.testing.assert_array_equal(rows, _parse_by_line(text, "x y z", tmp_path, 1))
    assert 1000 < accepted < 2500


MALFORMED = [
    (read_points, "", 1, "empty"),
    (read_points, "\n \n", 1, "empty"),
    (read_points, "0 0 0\n1 2\n", 2, "2 columns"),
    (read_points, "0 0\n0 1 2 3\n", 1, "2 columns"),
    (read_points, "0 0 0\n\n1 1 1\n", 2, "blank"),
    (read_points, "0 0 0\n0 x 0\n", 2, "y is 'x'"),
    (read_points, "0 0 0\n0 0 nan\n", 2, "z is 'nan'"),
    (read_points, "inf 0 0\n", 1, "x is 'inf'"),
    (read_points, "1e999 0 0\n", 1, "x is '1e999'"),
    (read_points, "0 0 0\n0 1e300 0\n", 2, "single precision"),
    (read_points, "0,0,0\n", 1, "1 columns"),
    (read_points, "0.5 0.5 0.5\n0.5 0.5 0.5\n\0\0\0\0", 3, "columns"),
    (read_planes, "", 1, "empty"),
    (read_planes, f"{PLANE}\n", 1, "first line"),
    (read_planes, f"-1\n{PLANE}\n", 1, "'-1'"),
    (read_planes, f"1.0\n{PLANE}\n", 1, "'1.0'"),
    (read_planes, f"2\n{PLANE}\n", 3, "ends after 1 of the 2"),
    (read_planes, f"1\n{PLANE}\n{PLANE}\n", 3, "more than the 1"),
    (read_planes, "0\njunk\n", 2, "1 columns"),
    (read_planes, f"1\n{PLANE} 0.9\n", 2, "7 columns"),
    (read_planes, f"2\n{PLANE}\n0 0 0 1 1 1\n", 3, "length 0"),
    (read_planes, f"2\n{PLANE}\n0 0 1 1 nan 1\n", 3, "py is 'nan'"),
    (read_results, f"1\n{PLANE}\n", 2, "6 columns"),
    (read_results, f"2\n{PLANE} 1\n{PLANE} nan\n", 3, "confidence is 'nan'"),
    (read_results, f"1\n\n{PLANE} 1\n", 2, "blank"),
    (read_symmetries, "", 1, "empty"),
    (read_symmetries, f"1\n{PLANE}\n", 2, "begins with '0'"),
    (read_symmetries, f"2\nplane {PLANE}\n", 3, "ends after 1 of the 2"),
    (read_symmetries, f"2\nplane {PLANE}\nplane 0 0 0 1 1 1\n", 3, "length 0"),
    (read_symmetries, "1\nplane\n", 2, "0 numbers"),
    (read_symmetries, "1\nplane 0 0 one 0 0 0\n", 2, "nz is 'one'"),
    (read_symmetries, f"1\naxis {PLANE} pi\n", 2, "'pi'"),
    (read_symmetries, f"2\nplane {PLANE}\n\n{PLANE}", 3, "begins with ''"),
    (read_subset, "1\n2\n-3\n", 3, "'-3'"),
    (read_subset, "1\n2\n1\n", 3, "already on line 1"),
    (read_subset, "", 1, "''"),
    (read_subset, "1\n\n2\n", 2, "''"),
    (read_subset, "1\n+2\n", 2, "'+2'"),
    (read_subset, "1\n\u0662\n", 2, "'\u0662' is not a cloud's ID"),
    (read_subset, "1\n" + "9" * 30 + "\n", 2, "is not a cloud's ID"),
    (read_points, "0 0 0\n0 0 \u0663\n", 2, "z is '\u0663'"),
    (read_compressed_points, "not compressed", 1, "unpack"),
]


@pytest.mark.parametrize(("read", "text", "line", "problem"), MALFORMED)
def test_a_malformed_file_is_refused_with_its_line(read, text, line, problem, tmp_path):
    path = tmp_path / "points3.txt"
    path.write_text(text, newline="")
    with pytest.raises(OfficialFileError) as error:
        read(path)
    assert str(error.value).startswith(f"{path}:{line}: ")
    assert problem in str(error.value)
    assert "\n" not in str(error.value)


def test_windows_line_ends_tabs_and_blank_ends_are_taken(tmp_path):
    path = tmp_path / "points3_sym.txt"
    path.write_bytes(b"2\r\n0\t0\t2\t1 2 3\r\n1 0 0 0 0 0\r\n\r\n")
    assert_same_planes(read_planes(path), Planes([[0, 0, 1], [1, 0, 0]], [[1, 2, 3], [0, 0, 0]]), 0)
    path.write_bytes(b"0\r\n")
    assert len(read_planes(path)) == 0


def test_a_full_disk_names_the_file_and_leaves_nothing(tmp_path, monkeypatch):
    def no_room(source, target):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.replace", no_room)
    with pytest.raises(OSError, match=r"no room for .*points0\.txt"):
        write_points(tmp_path / "points0.txt", np.zeros((1, 3)))
    assert not list(tmp_path.iterdir())


def test_a_subset_may_begin_with_the_mark_that_windows_writes(tmp_path):
    (tmp_path / "subset.txt").write_bytes(b"\xef\xbb\xbf7\r\n012\r\n")
    assert read_subset(tmp_path / "subset.txt") == [7, 12]
