"""Scenes of meshes, glTF and 3mf, from files of other programs: put in place; one line for what is forged."""

import base64
import json
import zipfile
from pathlib import Path

import numpy as np
import pytest
import trimesh

from symshrec.scans import CloudFileError, read_cloud
from symshrec.scans.gltf import read_gltf
from symshrec.scans.meshes import _parse

POINTS = np.random.default_rng(0).normal(size=(40, 3))
WRITTEN = Path(__file__).with_name("written")  # `scene` by trimesh 5.2 with lxml
MOST = 10**9


@pytest.fixture
def scene():
    """Two boxes of one mesh, each in a place of its own below a turned node, as trimesh has them."""
    scene = trimesh.Scene(base_frame="world")
    turned = trimesh.transformations.rotation_matrix(0.7, [1, 2, 3], [4, 5, 6])
    scene.graph.update("group", "world", matrix=turned)
    box = trimesh.creation.box((1, 2, 3))
    scene.add_geometry(box, "first", "box", "group", transform=trimesh.transformations.translation_matrix([7, 0, 0]))
    scene.graph.update("second", "group", geometry="box", matrix=np.diag([2.0, 1, 0.5, 1]))
    return scene


def corners_of(scene):
    placed = []
    for node in scene.graph.nodes_geometry:
        pose, name = scene.graph[node]
        placed.append(trimesh.transform_points(scene.geometry[name].triangles.reshape(-1, 3), pose).reshape(-1, 9))
    return np.sort(np.concatenate(placed), axis=0)


def same_mesh(mesh, scene):
    np.testing.assert_allclose(
        np.sort(mesh.vertices[mesh.triangles].reshape(-1, 9), axis=0), corners_of(scene), atol=1e-5
    )


def test_a_glb_has_its_meshes_where_its_nodes_put_them(scene, tmp_path):
    path = tmp_path / "a.glb"
    path.write_bytes(scene.export(file_type="glb"))
    same_mesh(_parse(path.read_bytes(), "glb", path), scene)
    cloud = read_cloud(path, samples=500)
    assert (cloud.points.shape, cloud.triangles) == ((500, 3), 24)


def test_a_gltf_reads_its_buffers_beside_it_alone(scene, tmp_path):
    for name, content in scene.export(file_type="gltf").items():
        (tmp_path / name).write_bytes(content)
    path = tmp_path / "model.gltf"
    same_mesh(_parse(path.read_bytes(), "gltf", path), scene)
    tree = json.loads(path.read_text())
    buffer = next(tmp_path.glob("*.bin"))
    inside = [dict(each, uri=data_uri((tmp_path / each["uri"]).read_bytes())) for each in tree["buffers"]]
    same_mesh(read_gltf(json.dumps(tree | {"buffers": inside}).encode(), path, MOST), scene)
    (tmp_path / "below").mkdir()
    for uri in (f"../{buffer.name}", str(buffer), f"%2e%2e/{buffer.name}"):
        outside = tree | {"buffers": [dict(each, uri=uri) for each in tree["buffers"]]}
        (tmp_path / "below" / "a.gltf").write_text(json.dumps(outside))
        with pytest.raises(CloudFileError, match="lies outside its folder"):
            read_cloud(tmp_path / "below" / "a.gltf")
    buffer.unlink()
    with pytest.raises(CloudFileError, match="is not there"):
        read_cloud(path)


def data_uri(content):
    return "data:application/octet-stream;base64," + base64.b64encode(content).decode()


def triangle(**changes):
    """A glTF of one triangle, with what changes in its tree."""
    content = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4").tobytes()
    return {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{"uri": data_uri(content), "byteLength": 36}],
    } | changes


def accessor(**changes):
    return [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"} | changes]


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        ({"asset": {"version": "1.0"}}, "of glTF version '1.0'"),
        ({"extensionsRequired": ["KHR_draco_mesh_compression"]}, "extension KHR_draco_mesh_compression"),
        ({"accessors": accessor(count=10**12)}, "which no file of this size holds"),
        ({"accessors": [{"componentType": 5126, "count": 10**9, "type": "VEC3"}]}, "which no file of this size holds"),
        ({"accessors": accessor(count=4)}, "needs 48 bytes of a view of 36"),
        ({"accessors": accessor(count=-3)}, "is VEC3 of -3"),
        ({"accessors": accessor(byteOffset=-12)}, "names a bufferView that is not there"),
        ({"accessors": accessor(componentType=7)}, "no valid glTF"),
        ({"bufferViews": [{"buffer": 0, "byteLength": 36, "byteStride": 0}]}, "needs"),
        ({"bufferViews": [{"buffer": 0, "byteLength": 36, "byteOffset": 9}]}, "needs"),
        ({"nodes": [{"mesh": 0, "children": [0]}]}, "below itself"),
        ({"nodes": [{"mesh": 3}]}, "no valid glTF"),
        ({"nodes": [{"mesh": 0, "matrix": [1, 2]}]}, "no valid glTF"),
        ({"nodes": [{"mesh": 0, "scale": ["a", 1, 1]}]}, "no valid glTF"),
        ({"nodes": []}, "no valid glTF"),
        ({"scenes": [{}]}, "no vertices"),
        ({"buffers": [{"uri": "data:;base64,!", "byteLength": 36}]}, "no base64"),
        ({"buffers": [{"byteLength": 36}]}, "names no file"),
    ],
)
def test_a_gltf_that_misleads_is_refused_in_a_line(changes, problem, tmp_path):
    path = tmp_path / "a.gltf"
    path.write_text(json.dumps(triangle(**changes)))
    with pytest.raises(CloudFileError, match=problem) as error:
        read_cloud(path)
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)


def test_sparse_normalised_and_fan_shaped_gltf(tmp_path):
    values = np.array([[0, 0, 0], [32767, 0, 0], [32767, 32767, 0], [0, 16384, 0]], "<i2")
    changed = np.array([3], "<u1").tobytes() + b"\0" + np.array([0, 32767, 0], "<i2").tobytes()
    tree = triangle(
        accessors=[
            {
                **{"bufferView": 0, "componentType": 5122, "count": 4, "type": "VEC3", "normalized": True},
                "sparse": {
                    "count": 1,
                    "indices": {"bufferView": 1, "componentType": 5121},
                    "values": {"bufferView": 1, "byteOffset": 2},
                },
            }
        ],
        bufferViews=[{"buffer": 0, "byteLength": 24}, {"buffer": 0, "byteOffset": 24, "byteLength": 8}],
        buffers=[{"uri": data_uri(values.tobytes() + changed), "byteLength": 32}],
        meshes=[{"primitives": [{"attributes": {"POSITION": 0}, "mode": 6}]}],
        extensionsRequired=["KHR_mesh_quantization"],
    )
    mesh = read_gltf(json.dumps(tree).encode(), tmp_path / "a.gltf", MOST)
    np.testing.assert_array_equal(mesh.vertices, [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    assert mesh.triangles.tolist() == [[0, 1, 2], [0, 2, 3]]


def test_parts_named_too_often_are_refused(tmp_path):
    many = triangle(nodes=[{"mesh": 0}] * 50, scenes=[{"nodes": list(range(50))}])
    text = json.dumps(many).encode()
    assert len(read_gltf(text, tmp_path / "a.gltf", MOST).triangles) == 50
    with pytest.raises(CloudFileError, match=r"take more memory|no file of this size"):
        read_gltf(text, tmp_path / "a.gltf", 3000)


def test_points_of_a_glb_are_the_cloud(tmp_path):
    path = tmp_path / "a.glb"
    path.write_bytes(trimesh.Scene(trimesh.PointCloud(POINTS)).export(file_type="glb"))
    np.testing.assert_allclose(read_cloud(path).points, POINTS, atol=1e-6)


MODEL = """<?xml version="1.0"?><model unit="inch" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">
<resources><object id="1"><mesh><vertices><vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/>
<vertex x="0" y="1" z="0"/></vertices><triangles><triangle v1="0" v2="1" v3="2"/></triangles></mesh></object>
<object id="2"><components><component objectid="1" transform="0 1 0 -1 0 0 0 0 1 5 0 0"/></components></object>
</resources><build><item objectid="2" transform="2 0 0 0 2 0 0 0 2 0 0 1"/></build></model>"""


def archive(path, **members):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        for name, content in members.items():
            file.writestr(name.replace("__", "/").replace("_model", ".model"), content)
    return path


def test_a_3mf_has_its_parts_in_their_places(scene):
    path = WRITTEN / "scene.3mf"
    same_mesh(_parse(path.read_bytes(), "3mf", path), scene)


def test_transforms_of_a_3mf(tmp_path):
    path = archive(tmp_path / "a.3mf", **{"3D__3dmodel_model": MODEL})
    mesh = _parse(path.read_bytes(), "3mf", path)
    assert mesh.vertices.tolist() == [[10, 0, 1], [10, 2, 1], [8, 0, 1]]  # turned and moved, then doubled and lifted
    assert mesh.triangles.tolist() == [[0, 1, 2]]


ENDLESS = MODEL.replace('<component objectid="1"', '<component objectid="2"')


@pytest.mark.parametrize(
    ("model", "problem"),
    [
        (MODEL.replace('v3="2"', 'v3="9"'), "a vertex that is not there"),
        (MODEL.replace('v3="2"', 'v3="99999999999999999999"'), r"3dmodel\.model\]:3: a triangle has a vertex"),
        (MODEL.replace('y="1"', 'y="one"'), r"3dmodel\.model\]:3: 'one' is no number"),
        (MODEL.replace('y="1"', ""), r"3dmodel\.model\]:3: '' is no number"),
        (MODEL.replace("-1 0 0 0 0 1 5 0 0", "1"), "a transform has 4 numbers"),
        (MODEL.replace('<item objectid="2"', '<item objectid="7"'), "its object '7' is not there"),
        (ENDLESS, "without end"),
        (MODEL[:-30], "no XML"),
        ("<!DOCTYPE model [<!ENTITY a 'b'>]>" + MODEL[21:], "declares a document type"),
    ],
)
def test_a_3mf_that_misleads_is_refused_in_a_line(model, problem, tmp_path):
    with pytest.raises(CloudFileError, match=problem) as error:
        read_cloud(archive(tmp_path / "a.3mf", **{"3D__3dmodel_model": model}))
    assert "\n" not in str(error.value)
