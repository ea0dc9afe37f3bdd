"""Files that were made to mislead, and rare ones that are right: each is read as it is meant, or refused in a line."""

import struct

import numpy as np
import pytest
import trimesh

from symshrec.scans import MOST_SAMPLES, CloudFileError, read_cloud
from symshrec.scans.meshes import _parse

FOUR = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"
THREE = "0 0 0\n1 0 0\n0 1 0\n"


def ply(vertices=3, faces=1, kind="ascii", more="", corners="vertex_indices"):
    axes = "".join(f"property float {axis}\n" for axis in "xyz")
    elements = f"element vertex {vertices}\n{axes}{more}element face {faces}\nproperty list uchar int {corners}\n"
    return f"ply\nformat {kind} 1.0\n{elements}end_header\n"


def npy(shape="(3, 3)", descr="'<f8'", body=72):
    header = f"{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}".encode()
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header + bytes(body)


@pytest.mark.parametrize(
    ("name", "content", "problem"),
    [
        ("a.npy", npy("(1000000000000, 3)"), "claims shape"),
        ("a.npy", npy("(1" + "0" * 30 + ", 3)"), "claims shape"),
        ("a.npy", npy("(3, 3"), "no array of numbers"),
        ("a.npy", npy("(True, 3)"), "the array has shape"),
        ("a.npy", npy("(-1, 3)"), "the array has shape"),
        ("a.npy", npy("(0, 1000000000000000000)"), "the array has shape"),
        ("a.npy", npy(descr="('<f8', (1000000000000,))"), "no array of numbers"),
        ("a.npy", npy(descr="'|O'"), "points are real numbers"),
        ("a.npy", npy("(9, 3)"), "only 72 bytes follow"),
        ("a.npy", b"\x93NUMPY\x02\x00\xff\xff\xff\xff", "no array of numbers"),
        ("a.obj", FOUR + "f 0 1 2\n", "a.obj:5: a face has vertex 0"),
        ("a.obj", FOUR + "f -1 -2 -9\n", "a.obj:5: a face has vertex -9"),
        ("a.obj", "f 1 2 5\n" + FOUR, "a.obj:1: a face has a vertex that is not there"),
        ("a.obj", FOUR + "f 1 2 99999999999999999999\n", "a.obj:5: a face has a vertex that is not there"),
        ("a.obj", FOUR + "\nf 1 2\n", "a.obj:6: a face has 2 corners"),
        ("a.obj", FOUR + "f\n", "a.obj:5: a face has 0 corners"),
        ("a.obj", FOUR + "f 1 2 x\n", "a.obj:5: 'x' is no whole number"),
        ("a.obj", FOUR + "f 1 2 1_0\n", "a.obj:5: '1_0' is no whole number"),
        ("a.obj", FOUR + "v 0 0\n", "a.obj:5: a vertex has 2 coordinates"),
        ("a.obj", "v 0 0 0\nv 0 zero 0\n", "a.obj:2: 'zero' is no number"),
        ("a.off", "OFF\n3 1 0\n" + THREE + "2 0 1\n", "a.off:6: a face has 2 corners"),
        ("a.off", "OFF\n3 1 0\n" + THREE + "3 0 1 -1\n", "a.off:6: a face has a vertex that is not there"),
        ("a.off", "OFF\n3 1 0\n" + THREE + "4 0 1 2\n", "a.off:6: a face of 4 corners has 3 numbers"),
        ("a.off", "OFF\n3 2 0\n" + THREE + "3 0 1 2\n", "4 of the 5 lines"),
        ("a.off", "OFF\n1000000000000 1 0\n0 0 0\n", "1 of the 1000000000001 lines"),
        ("a.off", "OFF\n-3 1 0\n0 0 0\n", "a.off:2: "),
        ("a.ply", ply("9" * 5000) + THREE, "a.ply:3: "),
        ("a.ply", ply(-3) + THREE, "a.ply:3: "),
        ("a.ply", ply(10**12) + THREE, "3 of the 1000000000001 lines"),
        ("a.ply", ply(10**18 - 1, kind="binary_little_endian") + THREE, "are too few for its 999999999999999999 rows"),
        ("a.ply", ply(kind="binary_middle_endian") + THREE, "a.ply:2: "),
        ("a.ply", ply(more="property quad w\n") + THREE, "a.ply:7: "),
        ("a.ply", ply(more="property float z\n") + THREE, "a.ply:7: "),
        ("a.ply", ply(corners="other") + THREE + "3 0 1 2\n", "faces without a list"),
        ("a.ply", ply() + THREE + "3 0 1 3\n", "a.ply:13: a face has a vertex that is not there"),
        ("a.ply", ply() + THREE + "2 0 1\n", "a.ply:13: a face has 2 corners"),
        ("a.ply", ply() + THREE + "-3 0 1 2\n", "a.ply:13: its vertex_indices goes beyond"),
        ("a.ply", ply() + THREE + "3 0 1 2 2\n", "a.ply:13: 5 columns instead of 4"),
        ("a.ply", ply() + "0 0 0\n1 0\n0 1 0\n3 0 1 2\n", "a.ply:11: 2 columns, but a vertex has 3"),
        ("a.ply", ply() + "0 0 0\n1 x 0\n0 1 0\n3 0 1 2\n", "a.ply:11: 'x' is no number"),
        ("a.ply", "ply\nproperty float x\nend_header\n", "a.ply:2: "),
        ("a.stl", bytes(80) + b"\xff\xff\xff\xff" + bytes(100), "are too few for its 4294967295 faces"),
        ("a.stl", "solid a\nfacet\nvertex 0 0 0\nvertex 1 0 0\nendfacet\nendsolid\n", "a.stl:5: the triangle above"),
        ("a.stl", "solid a\nfacet\nvertex 0 0 0\nvertex 1 0 x\n", "endsolid"),
        ("a.stl", "solid a\nvertex 0 0 0\nvertex 1 0 x\nvertex 0 1 0\nendsolid\n", "a.stl:3: 'x' is no number"),
    ],
)
def test_what_misleads_is_refused_in_a_line(name, content, problem, tmp_path):
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(CloudFileError) as error:
        read_cloud(path, samples=20)
    assert problem in str(error.value)
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("name", "content", "triangles"),
    [
        ("a.obj", FOUR + "f 1 2 3\nv 5 5 5\nf -1 -2 -3\n", [[0, 1, 2], [4, 3, 2]]),
        ("a.obj", FOUR + "f 1/1 2/2 3/3 # seen\nf 1//1 \\\n 3//3 4//4\n", [[0, 1, 2], [0, 2, 3]]),
        ("a.obj", "o my_part\n" + FOUR.replace("\n", " 0.5 0.5 0.5\n") + "f 1 2 3 4\n", [[0, 1, 2], [0, 2, 3]]),
        ("a.off", "# made\nOFF4 2 0 # here\n" + THREE + "\n0 0 1\n3 0 1 2 255 0 0\n4 0 1 2 3 0.5\n", [[0, 1, 2]] * 2),
        ("a.ply", ply(faces=2) + THREE + "\n3 0 1 2\n3 2 1 0\n", [[0, 1, 2], [2, 1, 0]]),
        ("a.ply", ply(corners="vertex_index") + THREE + "3 0 1 2\n", [[0, 1, 2]]),
        ("a.ply", ply(more="element edge 1\nproperty int a\n") + THREE + "5\n3 0 1 2\n", [[0, 1, 2]]),
        ("a.ply", ply(more="property list uchar int w\n") + "0 0 0 2 7 7\n1 0 0 0\n0 1 0 0\n3 0 1 2\n", [[0, 1, 2]]),
    ],
)
def test_what_is_rare_is_read(name, content, triangles, tmp_path):
    mesh = _parse(content.encode(), name[2:], tmp_path / name)
    assert mesh.triangles[: len(triangles), :2].tolist() == [each[:2] for each in triangles]
    np.testing.assert_array_equal(mesh.vertices[1], [1, 0, 0])


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("lengths", [[3, 3], [4, 4], [3, 5, 4]])
def test_polygons_of_any_size_in_binary(order, lengths, tmp_path):
    corners = np.random.default_rng(0).normal(size=(5, 3)).astype(np.float32)
    kind = {"<": "binary_little_endian", ">": "binary_big_endian"}[order]
    content = ply(5, len(lengths), kind).encode() + corners.astype(order + "f4").tobytes()
    content += b"".join(struct.pack(f"{order}B{length}i", length, *range(length)) for length in lengths)
    mesh = _parse(content, "ply", tmp_path / "a.ply")
    np.testing.assert_array_equal(mesh.vertices, corners)
    assert mesh.triangles.tolist() == [[0, at, at + 1] for length in lengths for at in range(1, length - 1)]
    with pytest.raises(CloudFileError, match="cannot be read as ply"):
        _parse(content[:-1], "ply", tmp_path / "a.ply")
    with pytest.raises(CloudFileError, match="1 bytes more than"):
        _parse(content + b"\n", "ply", tmp_path / "a.ply")


@pytest.mark.parametrize(("kind", "options"), [("ply", {}), ("ply", {"encoding": "ascii"}), ("obj", {}), ("off", {})])
def test_the_same_mesh_as_trimesh_reads(kind, options, tmp_path):
    mesh = trimesh.creation.icosphere(subdivisions=2).apply_scale((1, 2, 3))
    content = mesh.export(file_type=kind, **options)
    read = _parse(content if isinstance(content, bytes) else content.encode(), kind, tmp_path)
    np.testing.assert_array_equal(read.triangles, mesh.faces)
    np.testing.assert_allclose(read.vertices, mesh.vertices, atol=1e-6)


def test_samples_and_seed_have_limits(tmp_path):
    for arguments in ({"samples": 0}, {"samples": MOST_SAMPLES + 1}, {"seed": -1}):
        with pytest.raises(ValueError, match=next(iter(arguments))):
            read_cloud(tmp_path / "a.obj", **arguments)
