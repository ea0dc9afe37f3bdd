"""Reading anyone's files: the same cloud out of every format, and one line for what cannot be read."""

import numpy as np
import pytest
import trimesh

from symshrec.scans import EXTENSIONS, CloudFileError, read_cloud
from symshrec.scans.example import example_plane, write_example
from symshrec.scans.meshes import sample_surface

POINTS = np.round(np.random.default_rng(0).normal(size=(40, 3)), 4)
ROWS = [" ".join(f"{value:.4f}" for value in row) for row in POINTS]
ASCII_PLY = "ply\nformat ascii 1.0\nelement vertex {count}\n{axes}property uchar red\nend_header\n{rows}"


def written(path, text, **options):
    path.write_bytes(text if isinstance(text, bytes) else text.encode(options.get("encoding", "utf-8")))
    return path


def ascii_ply(rows, count=None):
    axes = "".join(f"property float {axis}\n" for axis in "xyz")
    return ASCII_PLY.format(count=count or len(rows), axes=axes, rows="".join(f"{row} 7\n" for row in rows))


@pytest.mark.parametrize(
    ("name", "text", "notes"),
    [
        ("a.txt", "\n".join(ROWS), 0),
        ("a.XYZ", "# scanned today\n\n" + "\r\n".join(ROWS) + "\r\n\r\n", 0),
        ("tabs.txt", "\n".join(row.replace(" ", "\t") for row in ROWS), 0),
        ("a.csv", "\ufeff" + "\n".join(row.replace(" ", ", ") for row in ROWS), 0),
        ("semicolon.csv", "\n".join(row.replace(" ", ";") for row in ROWS), 0),
        ("header.csv", "x,y,z\n" + "\n".join(row.replace(" ", ",") for row in ROWS), 1),
        ("count.xyz", "40\n" + "\n".join(ROWS), 1),
        ("colours.xyz", "\n".join(f"{row} 255 0 red # here" for row in ROWS), 1),
        ("normals.xyz", "\n".join(f"{row} nan nan nan" for row in ROWS), 1),
    ],
)
def test_text_of_every_kind(name, text, notes, tmp_path):
    cloud = read_cloud(written(tmp_path / name, text))
    np.testing.assert_array_equal(cloud.points, POINTS)
    assert len(cloud.notes) == notes
    assert cloud.triangles == 0


def test_columns_called_xyz_are_taken_wherever_they_are(tmp_path):
    x, y, z = POINTS.T
    table = np.stack([np.arange(40), z, x, y, x * 0 + 9], axis=1).tolist()
    text = 'id,"Z",X,Y,label\n' + "\n".join(",".join(map(str, row)) for row in table)
    cloud = read_cloud(written(tmp_path / "a.csv", text))
    np.testing.assert_array_equal(cloud.points, POINTS)
    assert "header" in cloud.notes[0]
    assert "2 more columns left out" in cloud.notes[1]


@pytest.mark.parametrize("dtype", ["float64", "float32", ">f8", "float16"])
def test_arrays(dtype, tmp_path):
    np.save(tmp_path / "a.npy", np.hstack([POINTS, POINTS]).astype(dtype))
    cloud = read_cloud(tmp_path / "a.npy")
    np.testing.assert_array_equal(cloud.points, POINTS.astype(dtype).astype(np.float64))
    assert cloud.points.dtype == np.float64
    assert cloud.notes == ("3 more columns left out",)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("ascii.ply", ascii_ply(ROWS)),
        ("binary.ply", trimesh.PointCloud(POINTS).export(file_type="ply")),
        ("a.obj", "".join(f"v {row}\n" for row in ROWS)),
        ("a.off", "OFF\n40 0 0\n" + "".join(f"{row}\n" for row in ROWS)),
    ],
)
def test_vertices_without_faces_are_the_points(name, content, tmp_path):
    cloud = read_cloud(written(tmp_path / name, content))
    np.testing.assert_allclose(cloud.points, POINTS, rtol=1e-6)
    assert cloud.triangles == 0
    assert cloud.notes == ()


def binary_ply(order, axis_type, also=(), ending="\n", elements=""):
    """POINTS between a colour and what `also` says, with (name, ply's type, numpy's type) each."""
    fields = [("red", "uchar", "u1"), *((axis, *axis_type) for axis in "xyz"), *also]
    rows = np.zeros(len(POINTS), [(name, order + kind) for name, _, kind in fields])
    rows["x"], rows["y"], rows["z"] = POINTS.T
    name = {"<": "little", ">": "big"}[order]
    lines = ["ply", f"format binary_{name}_endian 1.0", "comment a scan", f"element vertex {len(POINTS)}"]
    lines += [*(f"property {kind} {name}" for name, kind, _ in fields), *elements.split(";"), "end_header"]
    return ending.join([*filter(None, lines), ""]).encode() + rows.tobytes()


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("axis_type", [("float", "f4"), ("float64", "f8")])
@pytest.mark.parametrize("also", [(), [("nx", "double", "f8"), ("label", "int16", "i2")]])
@pytest.mark.parametrize("ending", ["\n", "\r\n"])
def test_a_binary_ply_of_points(order, axis_type, also, ending, tmp_path):
    cloud = read_cloud(written(tmp_path / "a.ply", binary_ply(order, axis_type, also, ending)))
    np.testing.assert_array_equal(cloud.points, POINTS.astype(axis_type[1]).astype(np.float64))
    assert cloud.points.flags.c_contiguous


def test_a_ply_with_an_empty_list_of_faces_is_points(tmp_path):
    faces = binary_ply("<", ("float", "f4"), elements="element face 0;property list uchar int vertex_indices")
    np.testing.assert_allclose(read_cloud(written(tmp_path / "a.ply", faces)).points, POINTS, rtol=1e-6)


@pytest.mark.parametrize("encoding", ["binary", "ascii"])
@pytest.mark.parametrize("extension", ["ply", "obj", "off", "stl", "stl_ascii"])
def test_meshes_give_points_on_their_surface(extension, encoding, tmp_path):
    options = {"encoding": encoding} if extension == "ply" else {}
    content = trimesh.creation.box((1, 2, 3)).export(file_type=extension, **options)
    path = written(tmp_path / f"box.{extension.removesuffix('_ascii')}", content)
    cloud = read_cloud(path, samples=500, seed=3)
    assert cloud.points.shape == (500, 3)
    assert cloud.triangles == 12
    assert "12 triangles, taken as 500 points" in cloud.notes[0]
    np.testing.assert_allclose(np.abs(cloud.points / [0.5, 1, 1.5]).max(axis=1), 1, atol=1e-6)
    np.testing.assert_array_equal(read_cloud(path, samples=500, seed=3).points, cloud.points)
    assert (read_cloud(path, samples=500, seed=4).points != cloud.points).any()


def test_samples_are_uniform_by_area():
    corners = np.array([[0, 0, 0], [3, 0, 0], [3, 2, 0], [0, 2, 0]], dtype=float)
    triangles = corners[[[0, 1, 2], [0, 2, 3], [1, 1, 2]]]
    points = sample_surface(triangles, 60_000, seed=0)
    counts, _, _ = np.histogram2d(points[:, 0], points[:, 1], bins=[6, 4], range=[[0, 3], [0, 2]])
    assert counts.sum() == 60_000
    assert np.abs(counts / 2_500 - 1).max() < 0.1
    assert sample_surface(triangles * 1e-150, 9, seed=0) is not None


def test_the_example_is_as_symmetric_as_it_says(tmp_path):
    path = tmp_path / "chair.ply"
    write_example(path)
    vertices = trimesh.load(path, process=False).vertices
    mirrored = example_plane().mirror(vertices)[0]
    distances = np.linalg.norm(mirrored[:, None] - vertices[None], axis=2).min(axis=1)
    assert distances.max() < 1e-6
    write_example(path)
    path.write_bytes(b"mine")
    with pytest.raises(ValueError, match="is there already"):
        write_example(path)


def broken_stl(triangles):
    return trimesh.creation.box().export(file_type="stl")[: 84 + 50 * triangles]


@pytest.mark.parametrize(
    ("name", "content", "problem"),
    [
        ("a.txt", "", "the file is empty"),
        ("a.txt", "# nothing\n\n", "the file is empty"),
        ("a.csv", "x,y,z\n", "is all there is"),
        ("a.txt", "0 0\n1 1\n", ":1: 2 columns, but a point needs three numbers, x y z; add one of zeros"),
        ("a.csv", "x,y\n0,0\n", ":2: 2 columns"),
        ("a.xyz", "0 0 0\n1 nan 1\n", ":2: y is 'nan'"),
        ("a.xyz", "0 0 0\n\n# c\n1 1 inf\n", ":4: z is 'inf'"),
        ("a.xyz", "x y z\n0 0 0\n1 one 1\n", ":3: y is 'one'"),
        ("a.xyz", "0 0 0\n1 1\n", ":2: 2 columns"),
        ("a.csv", "0,0,0\n1,,1\n", ":2: y is ''"),
        ("a.txt", "some words here\nand more of them\n", ":2: x is 'and'"),
        ("a.txt", bytes(range(256)), "no UTF-8 text"),
        ("a.txt", "0 0 0\n".encode("utf-16"), "no UTF-8 text"),
        ("a.npy", b"", "no array of numbers"),
        ("a.npy", b"\x93NUMPY\x01\x00v\x00{'descr'", "no array of numbers"),
        ("a.ply", "", "the file is empty"),
        ("a.ply", "hello\n", "does not begin as a ply file does"),
        ("a.ply", ascii_ply(ROWS[:5], count=9), "5 of the 9 lines"),
        ("a.ply", trimesh.creation.box().export(file_type="ply")[:-9], "cannot be read as ply"),
        ("a.ply", ascii_ply([*ROWS[:3], "0 nan 0"]), "point 4 is 0 nan 0"),
        ("a.ply", ascii_ply([]), "no vertices"),
        ("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "a.obj"),
        ("a.obj", "nothing\n", "no vertices"),
        ("a.obj", bytes(range(256)), "obj is a text format"),
        ("a.obj", "v 0 0 0\nv 0 0 0\nv 0 0 0\nf 1 2 3\n", "have no area"),
        ("a.off", "OFF\n9 0 0\n0 0 0\n", "cannot be read as off"),
        ("a.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n", "a.off"),
        ("a.stl", broken_stl(5), "too few for its 12 faces"),
        ("a.stl", "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\n", "endsolid"),
        ("a.dwg", "0 0 0\n", "unknown extension '.dwg'; what can be read: .txt"),
        ("noextension", "0 0 0\n", "unknown extension ''"),
    ],
)
def test_what_cannot_be_read_is_told_in_one_line(name, content, problem, tmp_path):
    path = written(tmp_path / name, content)
    with pytest.raises(CloudFileError) as told:
        read_cloud(path)
    assert problem in str(told.value)
    assert str(path) in str(told.value)
    assert "\n" not in str(told.value)


@pytest.mark.parametrize(
    ("array", "problem"),
    [
        (np.zeros((5, 2)), "three columns, x y z: add one of zeros"),
        (np.zeros((0, 3)), r"shape \(0, 3\)"),
        (np.zeros(9), r"shape \(9,\)"),
        (np.zeros((3, 500)), "transpose it"),
        (np.array([[0, 0, 0], [1, np.inf, 1]]), "point 2 is 1 inf 1"),
        (np.array([["a", "b", "c"]]), "holds <U1"),
        (np.zeros((4, 3), complex), "holds complex128"),
        (np.array([[None] * 3]), "holds object"),
    ],
)
def test_arrays_that_are_no_cloud(array, problem, tmp_path):
    np.save(tmp_path / "a.npy", array, allow_pickle=True)
    with pytest.raises(CloudFileError, match=problem):
        read_cloud(tmp_path / "a.npy")


def test_folders_and_missing_files(tmp_path):
    with pytest.raises(CloudFileError, match="this is a folder"):
        read_cloud(tmp_path)
    for extension in EXTENSIONS:
        with pytest.raises(FileNotFoundError):
            read_cloud(tmp_path / f"nowhere{extension}")
