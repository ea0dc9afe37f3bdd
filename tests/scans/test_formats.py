"""Every further format of points, from a file of another program: the same points; one line for what is wrong."""

import gzip
import io
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
import trimesh

from symshrec.scans import CloudFileError, read_cloud, source
from symshrec.scans.folder import CloudFolder

POINTS = np.round(np.random.default_rng(0).normal(size=(40, 3)), 4)
SURVEY = POINTS + np.array([456_789.25, 5_123_456.5, 312.0])  # metres, as UTM has them
WRITTEN = Path(__file__).with_name("written")  # POINTS by pypcd4 1.5, `scene` by trimesh 5.2 with lxml
ROWS = [" ".join(f"{value:.4f}" for value in row) for row in POINTS]


def test_archives_are_bounded_before_they_are_unpacked(tmp_path, monkeypatch):
    monkeypatch.setattr(source, "LEAST_BOUND", 10_000)
    bomb = np.zeros((100_000, 3))
    np.savez_compressed(tmp_path / "a.npz", bomb)
    with zipfile.ZipFile(tmp_path / "a.3mf", "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("3D/3dmodel.model", " " * 3_000_000)
    (tmp_path / "a.xyz.gz").write_bytes(gzip.compress(b"0 0 0\n" * 400_000))
    for name in ("a.npz", "a.3mf", "a.xyz.gz"):
        with pytest.raises(CloudFileError, match=r"to more than .* GB"):
            read_cloud(tmp_path / name)


@pytest.mark.parametrize("kind", ["xyz", "csv", "ply", "npy", "stl"])
def test_packed_files_are_what_is_in_them(kind, tmp_path):
    plain = tmp_path / f"a.{kind}"
    if kind == "stl":
        trimesh.creation.box().export(plain)
    elif kind == "ply":
        trimesh.PointCloud(POINTS).export(plain)
    elif kind == "npy":
        np.save(plain, POINTS)
    else:
        np.savetxt(plain, POINTS, delimiter={"xyz": " ", "csv": ","}[kind])
    packed = tmp_path / f"b.{kind}.GZ"
    packed.write_bytes(gzip.compress(plain.read_bytes()))
    np.testing.assert_array_equal(read_cloud(packed).points, read_cloud(plain).points)
    packed.write_bytes(packed.read_bytes()[:-9])
    with pytest.raises(CloudFileError, match="does not unpack"):
        read_cloud(packed)


def test_npz(tmp_path):
    path = tmp_path / "a.npz"
    x, y, z = SURVEY.T
    for arrays in (
        {"a": SURVEY},
        {"points": SURVEY, "normals": POINTS, "label": np.array(["x"])},
        {"x": x, "Y": y, "z": z},
    ):
        np.savez_compressed(path, **arrays)
        np.testing.assert_array_equal(read_cloud(path).points, SURVEY)
    for arrays, problem in (
        ({"a": SURVEY, "b": SURVEY}, "call it points"),
        ({"a": np.array([None])}, "none of numbers"),
        ({"a": x}, r"a \(40,\).* save one \(N, 3\) as points"),
        ({"x": x, "y": y, "z": z[1:]}, "should be of one length"),
    ):
        np.savez(path, **arrays)
        with pytest.raises(CloudFileError, match=problem):
            read_cloud(path)
    path.write_bytes(path.read_bytes()[:-30])
    with pytest.raises(CloudFileError, match="cannot be read as npz"):
        read_cloud(path)


@pytest.mark.parametrize("kind", ["ascii", "binary", "binary_compressed"])
def test_pcd_of_every_kind(kind):
    cloud = read_cloud(WRITTEN / f"{kind}.pcd")
    expected = np.delete(np.concatenate([POINTS, POINTS[:5]]), 10, axis=0).astype(np.float32)
    np.testing.assert_allclose(cloud.points, expected, rtol=0, atol=0 if kind != "ascii" else 1e-10)
    assert cloud.notes == ("1 places without a measurement (NaN) left out", "1 more column left out")


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        (b"POINTS 45", b"POINTS 45000000000", "are too few for the 45000000000 points"),
        (b"POINTS 45", b"POINTS -5", "'-5' where a whole number"),
        (b"SIZE 4", b"SIZE 3", "TYPE F and SIZE 3"),
        (b"SIZE 4", b"SIZE", "other numbers of SIZE"),
        (b"DATA", b"DATUM", ":10: 'DATUM' is no line"),
        (b"x y z", b"a b c", "need x, y and z"),
        (b"COUNT 1", b"COUNT 99999999", "it holds"),
        (b"DATA binary_compressed\n", b"DATA binary_compressed\n\xff\xff\xff\xff", "are too few"),
    ],
)
def test_a_pcd_that_misleads_is_refused_in_a_line(old, new, problem, tmp_path):
    content = (WRITTEN / "binary_compressed.pcd").read_bytes()
    (tmp_path / "a.pcd").write_bytes(content.replace(old, new))
    with pytest.raises(CloudFileError, match=problem):
        read_cloud(tmp_path / "a.pcd")
    (tmp_path / "a.pcd").write_bytes(content[:-3])
    with pytest.raises(CloudFileError, match="cut short"):
        read_cloud(tmp_path / "a.pcd")


COMMAS = [row.replace(".", ",") for row in ROWS]


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.asc", "\n".join(COMMAS)),
        ("a.csv", "\n".join(row.replace(" ", ";") for row in COMMAS)),
        ("tabs.txt", "x\ty\tz\n" + "\n".join(row.replace(" ", "\t") for row in COMMAS)),
        ("named.csv", "id;x;y;z\n" + "\n".join("a b;" + row.replace(" ", ";") for row in COMMAS)),
        ("whole.txt", "0 0 0\n" + "\n".join(COMMAS)),
        ("a.pts", "40\n" + "\n".join(f"{row} -12 255 0 9" for row in ROWS)),
    ],
)
def test_decimal_commas_and_pts(name, text, tmp_path):
    path = tmp_path / name
    path.write_text(text)
    cloud = read_cloud(path)
    np.testing.assert_array_equal(cloud.points[-40:], POINTS)
    assert ("commas taken as decimal points" in cloud.notes) == (name != "a.pts")


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("1 2 3\n1,5 2,5 x\n", ":2: x is '1,5'"),
        ("1,5 2,5 3,5\n1,5 2,5 three\n", ":2: z is 'three'"),
        ("ncols 4\nnrows 4\n", "a grid of heights"),
    ],
)
def test_text_that_is_no_cloud(text, problem, tmp_path):
    (tmp_path / "a.asc").write_text(text)
    with pytest.raises(CloudFileError, match=problem):
        read_cloud(tmp_path / "a.asc")


def test_standard_input_is_known_by_its_first_bytes(tmp_path, monkeypatch):
    np.save(tmp_path / "a.npy", POINTS)
    np.savez(tmp_path / "a.npz", POINTS)
    box = trimesh.creation.box()
    contents = {name: (tmp_path / f"a.{name}").read_bytes() for name in ("npy", "npz")}
    contents["pcd"] = (WRITTEN / "binary.pcd").read_bytes()
    contents["txt"] = "\n".join(ROWS).encode()
    contents["3mf"] = (WRITTEN / "scene.3mf").read_bytes()
    contents |= {kind: box.export(file_type=kind) for kind in ("glb", "ply", "obj", "off", "stl", "stl_ascii")}
    for name, content in contents.items():
        content = content if isinstance(content, bytes) else content.encode()
        path = tmp_path / f"b.{name.removesuffix('_ascii')}"
        path.write_bytes(content)
        for given in (content, gzip.compress(content)):
            monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(given)))
            np.testing.assert_array_equal(read_cloud("-").points, read_cloud(path).points, err_msg=name)
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(b"0 0 0\n0 0 nan\n")))
    with pytest.raises(CloudFileError, match=r"^standard input:2: z is 'nan'"):
        read_cloud("-")


@pytest.mark.parametrize("kind", ["las", "laz"])
def test_las_keeps_survey_coordinates(kind, tmp_path):
    laspy = pytest.importorskip("laspy")
    pytest.importorskip("lazrs")
    header = laspy.LasHeader(point_format=3, version="1.2")
    header.scales, header.offsets = [1e-4] * 3, [456_000, 5_123_000, 0]
    scan = laspy.LasData(header)
    scan.x, scan.y, scan.z = SURVEY.T
    path = tmp_path / f"a.{kind}"
    scan.write(path)
    np.testing.assert_allclose(read_cloud(path).points, SURVEY, rtol=0, atol=2e-9)
    content = bytearray(path.read_bytes())
    path.write_bytes(content[: len(content) * 2 // 3])
    with pytest.raises(CloudFileError, match=r"las|points that it claims"):
        read_cloud(path)
    forged = {100: "claims 4,294,967,295 records", 107: "claims 4,294,967,295 points"}
    if kind == "laz":  # the table of chunks, whose place stands before the first of them
        place = int.from_bytes(content[96:100], "little")
        forged[int.from_bytes(content[place : place + 8], "little") + 4] = "claims 4,294,967,295 chunks"
    for place, problem in forged.items():
        path.write_bytes(content[:place] + b"\xff" * 4 + content[place + 4 :])
        with pytest.raises(CloudFileError, match=problem):
            read_cloud(path)


def test_e57_has_every_scan_in_its_place(tmp_path):
    pye57 = pytest.importorskip("pye57")
    path = tmp_path / "a.e57"
    with pye57.E57(str(path), mode="w") as file:
        columns = {f"cartesian{axis}": column for axis, column in zip("XYZ", POINTS.T, strict=True)}
        file.write_scan_raw(columns, rotation=np.array([1.0, 0, 0, 0]), translation=SURVEY[0] - POINTS[0])
        file.write_scan_raw({**columns, "cartesianInvalidState": np.arange(40) % 2})
    cloud = read_cloud(path)
    stored = POINTS.astype(np.float32)  # by pye57, about a scanner in double precision
    placed = stored + (SURVEY[0] - POINTS[0])
    np.testing.assert_allclose(cloud.points, np.concatenate([placed, stored[::2]]), rtol=0, atol=2e-9)
    assert cloud.notes == ("its 2 scans taken together", "20 places without a measurement left out")
    packed = tmp_path / "b.e57.gz"
    packed.write_bytes(gzip.compress(path.read_bytes()))
    np.testing.assert_array_equal(read_cloud(packed).points, cloud.points)
    path.write_bytes(path.read_bytes()[:-900])
    with pytest.raises(CloudFileError, match="cannot be read as e57"):
        read_cloud(path)


def test_parquet_by_the_names_of_its_columns(tmp_path):
    pyarrow, parquet = (pytest.importorskip(name) for name in ("pyarrow", "pyarrow.parquet"))
    path, (x, y, z) = tmp_path / "a.parquet", SURVEY.T
    parquet.write_table(pyarrow.table({"label": ["a"] * 40, "Z": z, "X": x, "Y": y}), path)
    np.testing.assert_array_equal(read_cloud(path).points, SURVEY)
    for columns, problem in (
        ({"x": x, "y": y, "z": ["a"] * 40}, "its column 'z' holds string"),
        ({"x": x, "y": y}, "points need x, y and z"),
        ({"x": x, "y": y, "z": [None, *z[1:]]}, "point 1 is .* nan"),
        ({"x": [], "y": [], "z": []}, r"holds null|no points"),
    ):
        parquet.write_table(pyarrow.table(columns), path)
        with pytest.raises(CloudFileError, match=problem):
            read_cloud(path)
    path.write_bytes(b"PAR1 and more")
    with pytest.raises(CloudFileError, match="cannot be read as parquet"):
        read_cloud(path)


@pytest.mark.parametrize(("kind", "extra"), [("las", "scan"), ("e57", "scan"), ("parquet", "parquet")])
def test_a_missing_extra_is_named(kind, extra, tmp_path, monkeypatch):
    for name in ("laspy", "pye57", "pyarrow", "pyarrow.parquet"):
        monkeypatch.setitem(sys.modules, name, None)
    (tmp_path / f"a.{kind}").write_bytes(b"any")
    with pytest.raises(CloudFileError, match=rf"pip install 'symshrec\[{extra}\]'"):
        read_cloud(tmp_path / f"a.{kind}")


def test_a_folder_holds_every_kind_about_its_own_centre(tmp_path):
    np.savez(tmp_path / "a.npz", SURVEY)
    (tmp_path / "b.csv.gz").write_bytes(gzip.compress("\n".join(COMMAS).replace(" ", ";").encode()))
    (tmp_path / "notes.md").write_text("none")
    folder = CloudFolder(tmp_path)
    assert folder.names.tolist() == ["a.npz", "b.csv.gz"]
    for place, points in enumerate((SURVEY, POINTS)):
        middle = (points.min(axis=0) + points.max(axis=0)) / 2
        np.testing.assert_allclose(folder[place].points, points - middle, atol=1e-6)
