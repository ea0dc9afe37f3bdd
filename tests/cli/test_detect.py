"""`symshrec detect`: what it prints and writes, for one file and for many, and what it says of bad ones."""

import gzip
import io
import json
import os
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

from symshrec import api
from symshrec.benchmark.official import read_results
from symshrec.cli import detect, main, products
from symshrec.methods.base import SymmetryMethod
from symshrec.planes import Planes
from symshrec.scans import read_cloud

PLANES = Planes(np.eye(3), np.zeros((3, 3)), [0.9, 0.3, 0.7])  # in the frame that a method sees


class Known(SymmetryMethod):
    """Finds the same planes in every cloud."""

    def detect(self, points):
        return PLANES


@pytest.fixture(autouse=True)
def known_method(monkeypatch):
    monkeypatch.setattr(api, "named_method", lambda name, **arguments: Known())


@pytest.fixture
def box(tmp_path, monkeypatch):
    """A mesh with three mirror planes, about (1, 2, 3), in the working folder."""
    monkeypatch.chdir(tmp_path)
    trimesh.creation.box((1, 2, 3)).apply_translation((1, 2, 3)).export("box.ply")
    return "box.ply"


def run(*arguments):
    return main(["detect", *map(str, arguments)])


def test_the_table_has_the_planes_by_confidence_in_the_files_coordinates(box, capsys):
    assert run(box, "--samples", 2000) == 0
    told = capsys.readouterr()
    title, header, *rows, group = told.out.splitlines()
    assert title.startswith("box.ply: 2 mirror planes (2,000 points, diagonal 3.7")
    columns = [
        "colour",
        "normal",
        "offset",
        "point",
        "confidence",
        "support",
        "mean residual",
        "% of diagonal",
        "asymmetry",
    ]
    assert header.split() == " ".join(columns).split()
    assert len(rows) == 2
    for row, (axis, confidence) in zip(rows, ((0, 0.9), (2, 0.7)), strict=True):
        number, colour, *cells = row.split()
        assert colour == ("vermilion", "blue")[int(number) - 1]
        cells = [float(number), *map(float, cells)]
        assert cells[1:4] == np.eye(3)[axis].tolist()
        np.testing.assert_allclose(cells[4:8], [axis + 1, 1, 2, 3], atol=0.02)
        assert cells[8] == confidence
        assert cells[10] < 1e-4
        assert cells[12] < 1e-4
    assert group.startswith("point group C2v: 2 mirrors, axes of rotation: 1 of order 2 (axis 0.00000 1.00000 0.00000")
    assert "a mesh of 12 triangles, taken as 2,000 points" in told.err


def test_json_holds_everything_and_agrees_with_the_other_outputs(box, capsys):
    drawn = ("--samples", 500, "--seed", 3)
    assert run(box, *drawn, "--json", "out.json", "--res", "box_res.txt", "--plot", "box.png") == 0
    text = Path("out.json").read_text()
    report = json.loads(text)
    assert report["format"] == "symshrec detections 1"
    assert (report["method"], report["arguments"], report["min_confidence"]) == ("m4", {}, 0.5)
    (cloud,) = report["clouds"]
    assert (cloud["file"], cloud["points"], cloud["triangles"]) == ("box.ply", 500, 12)
    points = read_cloud("box.ply", 500, 3).points
    assert cloud["diagonal"] == np.linalg.norm(np.ptp(points, axis=0))
    results = read_results("box_res.txt")
    planes = {name: np.array([row[name] for row in cloud["planes"]]) for name in cloud["planes"][0]}
    np.testing.assert_allclose(planes["normal"], results.normals, atol=1e-11)
    np.testing.assert_allclose(planes["point"], results.points, atol=1e-11)
    np.testing.assert_allclose(planes["offset"], results.offsets, atol=1e-10)
    np.testing.assert_array_equal(planes["confidence"], results.confidences)
    np.testing.assert_allclose(planes["residual_percent"], 100 * planes["residual"] / cloud["diagonal"])
    assert Path("box.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    capsys.readouterr()
    assert run(box, *drawn, "--json", "-") == 0
    assert capsys.readouterr().out == text


def test_limits_and_no_plane_at_all(box, capsys):
    assert run(box, "--max-planes", 1, "--min-confidence", 0) == 0
    assert capsys.readouterr().out.count("\n") == 4
    assert run(box, "--min-confidence", 0.95, "--json", "none.json", "--res", "none_res.txt", "--plot", "none.png") == 0
    assert "box.ply: no mirror plane of confidence 0.95 or more (20,000 points" in capsys.readouterr().out
    assert json.loads(Path("none.json").read_text())["clouds"][0]["planes"] == []
    assert len(read_results("none_res.txt")) == 0


def test_several_files_and_the_bad_ones_among_them(box, capsys):
    np.save("b.npy", read_cloud(box).points)
    Path("bad.txt").write_text("0 0 0\n0 0 nan\n")
    Path("line.xyz").write_text("0 0 0\n1 1 1\n2 2 2\n")
    assert run(box, "bad.txt", "gone.npy", "line.xyz", "b.npy", "--res", "{stem}_res.txt", "--json", "all.json") == 2
    told = capsys.readouterr()
    assert told.out.count("2 mirror planes") == 2
    assert "symshrec detect: bad.txt:2: z is 'nan'" in told.err
    assert "symshrec detect: line.xyz: all points (3) are on a straight line" in told.err
    assert "gone.npy" in told.err
    assert told.err.endswith("symshrec detect: 3 of 5 files failed, as named above\n")
    report = json.loads(Path("all.json").read_text())
    assert [each["file"] for each in report["clouds"]] == ["box.ply", "b.npy"]
    assert [each["file"] for each in report["failures"]] == ["bad.txt", "gone.npy", "line.xyz"]
    assert len(read_results("b_res.txt")) == 2


def test_folders_of_outputs_are_made(box):
    Path("deep").mkdir()
    Path("deep/b.ply.gz").write_bytes(gzip.compress(Path(box).read_bytes()))
    outputs = ("--res", "res/{stem}/x_res.txt", "--plot", "pictures/{stem}.png", "--json", "a/b/c.json")
    assert run(box, "deep/b.ply.gz", *outputs, "--samples", 300) == 0
    made = {str(path) for folder in ("res", "pictures", "a") for path in Path(folder).rglob("*.*")}
    named = {name.format(stem=stem) for name in outputs[1::2] for stem in ("box", "b")}
    assert made == named
    assert run(box, "--res", "never/x.pdf") == 2
    assert not Path("never").exists()


def test_standard_input(box, capsys, monkeypatch):
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(Path(box).read_bytes())))
    assert run("-", "--samples", 300, "--res", "{stem}_res.txt", "--json", "all.json") == 0
    told = capsys.readouterr()
    assert told.out.startswith("standard input: 2 mirror planes (300 points")
    assert told.err.startswith("standard input: a mesh of 12 triangles")
    assert len(read_results("stdin_res.txt")) == 2
    assert json.loads(Path("all.json").read_text())["clouds"][0]["file"] == "-"
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(b"0 0 0\n1 -1\n")))
    assert run("-") == 2
    assert capsys.readouterr().err.startswith("symshrec detect: standard input:2: 2 columns")


def test_plane_numbers_stand_out_in_a_terminal(box, monkeypatch):
    class Terminal(io.StringIO):
        def isatty(self):
            return True

    monkeypatch.setenv("NO_COLOR", "")
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(sys, "stdout", Terminal())
    assert run(box, "--samples", 300) == 0
    rows = sys.stdout.getvalue().splitlines()[2:-1]  # between the header and the group
    assert [row.partition("  ")[0] for row in rows] == ["\033[1;38;5;166m1\033[0m", "\033[1;38;5;25m2\033[0m"]


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        ([], "no file to detect on"),
        (["gone.ply"], "No such file"),
        (["box.pdf"], "unknown extension '.pdf'"),
        (["box.ply", "--plot", "box.gif"], "unknown extension; draw to .png or .html"),
        (["box.ply", "--json", "box.ply/a.json"], "--json box.ply/a.json: no folder box.ply can be made"),
        (["-", "-"], "can be read once"),
        (["box.ply", "--res", "box.res"], "called OUT_res.txt"),
        (["box.ply", "b.ply", "--plot", "box.png"], "is one file for 2; put {stem} into its name"),
        (["box.ply", "box.xyz", "--plot", "{stem}.png"], "several files are called box"),
    ],
)
def test_a_user_error_is_one_line(arguments, problem, box, capsys):
    assert run(*arguments) == 2
    told = capsys.readouterr()
    assert problem in told.err
    assert told.err.count("\n") == 1
    assert told.err.startswith("symshrec detect: ")
    assert told.out == ""


@pytest.mark.parametrize("word", ["neighbours", "3=4", "a={"])
def test_a_setting_is_name_and_value(word, box, capsys):
    with pytest.raises(SystemExit) as end:
        run(box, "--set", word)
    assert end.value.code == 2
    assert ("is no value for a" if word == "a={" else "is not of the form NAME=VALUE") in capsys.readouterr().err


def test_the_methods_own_arguments_reach_it(box, monkeypatch):
    asked = []
    monkeypatch.setattr(api, "named_method", lambda name, **given: asked.append((name, given)) or Known())
    assert run(box, "--method", "m3", "--set", "neighbours=250", "mollify=1.0e-4", "--set", "title=x") == 0
    assert asked == [("m3", {"neighbours": 250, "mollify": 1e-4, "title": "x"})]


def test_the_example_needs_no_file(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert run("--example", "--samples", 300) == 0
    assert "chair.ply: 2 mirror planes (300 points" in capsys.readouterr().out
    assert run("chair.ply", "--samples", 300) == 0


def test_the_page_is_whole_and_asks_for_nothing_from_outside(box):
    pytest.importorskip("plotly")
    assert run(box, "--samples", 300, "--plot", "box.html") == 0
    page = Path("box.html").read_text(encoding="utf-8")
    assert 1e6 < len(page) < 6e6
    assert "<script src" not in page
    assert "plane 1, confidence 0.90" in page
    assert "plane 3" not in page


def test_the_page_says_what_it_needs(box, monkeypatch, capsys):
    monkeypatch.setattr(products, "find_spec", lambda name: None)
    assert run(box, "--plot", "box.html") == 2
    assert "pip install 'symshrec[plot]'" in capsys.readouterr().err


HEADERS = ["(1000000000000, 3)", "(1" + "0" * 30 + ", 3)", "(3, 3", "(True, 3)"]  # MemoryError, OverflowError, ...


def test_no_file_ends_a_batch(box, capsys):
    for place, shape in enumerate(HEADERS):
        header = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}".encode()
        Path(f"{place}.npy").write_bytes(b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header + bytes(72))
    assert run(*(f"{place}.npy" for place in range(4)), box, "--json", "all.json") == 2
    told = capsys.readouterr()
    assert told.out.count("2 mirror planes") == 1
    lines = [line for line in told.err.splitlines() if line.startswith("symshrec detect: ")]
    assert [line.split(": ")[1] for line in lines[:4]] == [f"{place}.npy" for place in range(4)]
    assert lines[4:] == ["symshrec detect: 4 of 5 files failed, as named above"]
    assert len(json.loads(Path("all.json").read_text())["failures"]) == 4


@pytest.mark.parametrize(
    "error", [MemoryError(), RecursionError("deep"), TypeError("an\nodd one"), ZeroDivisionError()]
)
def test_whatever_a_method_raises_the_other_files_are_done(error, box, monkeypatch, capsys):
    calls = []

    def read(path, samples, seed):
        calls.append(path)
        if len(calls) == 1:
            raise error
        return read_cloud(path, samples, seed)

    monkeypatch.setattr(detect, "read_cloud", read)
    assert run(box, box, "--json", "all.json") == 2
    told = capsys.readouterr()
    assert told.out.count("2 mirror planes") == 1
    assert told.err.count("symshrec detect: box.ply: ") == 1
    report = json.loads(Path("all.json").read_text())
    assert (len(report["clouds"]), len(report["failures"]), report["remaining"]) == (1, 1, [])


def test_what_was_found_is_written_when_a_batch_is_interrupted(box, monkeypatch, capsys):
    calls = []

    def read(path, samples, seed):
        calls.append(path)
        if len(calls) == 2:
            raise KeyboardInterrupt
        return read_cloud(path, samples, seed)

    monkeypatch.setattr(detect, "read_cloud", read)
    assert run(box, box, box, "--json", "all.json") == 130
    report = json.loads(Path("all.json").read_text())
    assert (len(report["clouds"]), report["failures"], report["remaining"]) == (1, [], ["box.ply", "box.ply"])


def test_a_name_that_the_terminal_cannot_show(box, monkeypatch):
    names = [os.fsdecode(b"b\xffx.ply"), "b\u00e9.ply", "two\nlines.ply"]
    for name in names:
        Path(name).write_bytes(Path(box).read_bytes())
    out = io.TextIOWrapper(io.BytesIO(), "ascii")
    monkeypatch.setattr(sys, "stdout", out)
    assert run(*names, box, "--json", "all.json", "--samples", 300) == 0
    out.flush()
    told = out.buffer.getvalue().decode()
    for shown in (r"b\udcffx.ply: 2 mirror", r"b\xe9.ply: 2 mirror", r"two\nlines.ply: 2 mirror", "box.ply: 2 mirror"):
        assert f"\n{shown}" in f"\n{told}"
    assert [each["file"] for each in json.loads(Path("all.json").read_text())["clouds"]] == [*names, box]


def test_samples_are_bounded(box, capsys):
    assert run(box, "--samples", 10**11) == 2
    assert "--samples 100000000000: at most 10,000,000 points" in capsys.readouterr().err
