"""Manifests and shards that were forged with right checksums: refused in a line that names the file and the field."""

import hashlib
import json
import struct

import numpy as np
import pytest
from safetensors.numpy import load, save

from symshrec.benchmark.config import BenchmarkConfig, SplitConfig, SurfaceConfig
from symshrec.benchmark.generate import generate_dataset
from symshrec.benchmark.manifest import ShardRecord
from symshrec.benchmark.shards import ShardedSplit, ShardError
from symshrec.benchmark.tasks import request_of, sidecar_text
from symshrec.files.foreign import is_plain_name

CONFIG = BenchmarkConfig(
    surface=SurfaceConfig(points=64, citrus_points=128), splits={"test": SplitConfig(20)}, clouds_per_shard=10
)
SHARD = "test-00000.safetensors"


@pytest.fixture(scope="module")
def pristine(tmp_path_factory):
    root = tmp_path_factory.mktemp("shards")
    generate_dataset(CONFIG, root, workers=1, progress=False)
    return root


@pytest.fixture
def root(pristine, tmp_path):
    for path in pristine.iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    return tmp_path


def refusal(root, file="manifest.json", verify=True):
    """What is raised where everything in the split is read."""
    with pytest.raises(ShardError) as error:
        read_all(root, verify)
    assert str(root / file) in str(error.value)
    assert "\n" not in str(error.value)
    return str(error.value)


def read_all(root, verify=True):
    clouds = ShardedSplit(root, "test", verify=verify)
    return [clouds.families, clouds.solids, clouds.perturbations, *(clouds[at] for at in range(len(clouds)))]


def with_manifest(root, change):
    manifest = json.loads((root / "manifest.json").read_text())
    change(manifest)
    (root / "manifest.json").write_text(json.dumps(manifest))


def put(root, data):
    """Replace the first shard, and its size and sha256 in the manifest."""
    (root / SHARD).write_bytes(data)
    own = {"bytes": len(data), "sha256": hashlib.sha256(data).hexdigest()}
    with_manifest(root, lambda manifest: manifest["shards"][0].update(own))


@pytest.mark.parametrize(
    "name", ["../x", "/x", "a/b", "a\\b", "C:x", "", ".", "..", "a\0", "a\n", "\ud800", "x" * 256, 3]
)
def test_names_that_are_paths_or_none(name):
    assert not is_plain_name(name)
    assert is_plain_name("test-00000.safetensors")


@pytest.mark.parametrize(
    ("place", "field", "value"),
    [
        *(
            ("shards", "file", value)
            for value in ("../x.safetensors", "/x.safetensors", "x", 7, None, "test-00001.safetensors")
        ),
        *(("shards", "split", value) for value in ("../x", "te st", 3, None)),
        *(
            ("shards", field, value)
            for field in ("clouds", "points", "max_planes", "bytes", "first")
            for value in (-1, 1.5, "3", None, True, 10**30)
        ),
        *(
            ("shards", field, value)
            for field in ("families", "solids", "perturbations")
            for value in (None, [], {"x": "y"}, {"x": 99})
        ),
        *(("shards", "sha256", value) for value in (None, "", "A" * 64)),
        *(("splits", field, value) for field in ("clouds", "points", "max_planes") for value in (-1, 1.5, None, 5)),
        *(("splits", "families", value) for value in (None, {"x": 20})),
    ],
)
def test_a_manifest_whose_fields_cannot_be(place, field, value, root):
    with_manifest(root, lambda manifest: manifest[place][0 if place == "shards" else "test"].update({field: value}))
    told = refusal(root)
    assert field in told or "counts of split" in told or "listed twice" in told


@pytest.mark.parametrize(
    "change",
    [
        lambda manifest: manifest["shards"].reverse(),
        lambda manifest: manifest["shards"].pop(0),
        lambda manifest: manifest["shards"].append(manifest["shards"][1]),
        lambda manifest: manifest["splits"].update(other=manifest["splits"]["test"]),
        lambda manifest: manifest["splits"].clear(),
        lambda manifest: manifest.update(shards=[]),
        lambda manifest: manifest.update(shards=["a"]),
        lambda manifest: manifest.update(seed=7),
        lambda manifest: manifest.update(config=[]),
        lambda manifest: manifest.update(max_planes=1),
        lambda manifest: manifest.update(more=1),
    ],
)
def test_a_manifest_that_does_not_add_up(change, root):
    with_manifest(root, change)
    assert "is no manifest of shards" in refusal(root)


@pytest.mark.parametrize("text", [b"[" * 100_000, b"\xff\xfe{}", b"NaN", b"9" * 5000])
def test_a_manifest_that_is_no_json(text, root):
    (root / "manifest.json").write_bytes(text)
    refusal(root)


def changed(at, value):
    def change(array):
        array = array.copy()
        array[at] = value
        return array

    return change


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("points", lambda array: array.astype(np.float64)),
        ("points", lambda array: array[:, :2]),
        ("point_starts", changed(2, 0)),
        ("point_starts", changed(1, 0)),
        ("point_starts", changed(0, 5)),
        ("point_starts", changed(-1, 10**9)),
        ("point_starts", lambda array: array.astype(np.int32)),
        ("point_starts", lambda array: array[:-2]),
        ("plane_starts", changed(-1, 10**6)),
        ("plane_starts", changed(1, -1)),
        ("plane_normals", lambda array: array * np.nan),
        ("plane_normals", lambda array: array * 3),
        ("plane_normals", lambda array: array * 0),
        ("plane_normals", lambda array: array.astype(np.float32)),
        ("plane_points", lambda array: np.vstack([array, array])),
        ("plane_points", changed((0, 0), np.inf)),
        ("family", changed(0, 200)),
        ("family", lambda array: array[::-1] * 0),
        ("solid", changed(0, 9)),
        ("perturbation", lambda array: array.astype(np.float32)),
        ("rotation", lambda array: array * 5),
        ("rotation", lambda array: array * np.nan),
        ("translation", lambda array: array[:2]),
        ("parameters", lambda array: array[:, :-1]),
        ("parameters", lambda array: array * np.inf),
        ("more", lambda array: np.zeros(3)),
        ("rotation", lambda array: None),
    ],
)
def test_a_shard_whose_arrays_cannot_be(name, change, root):
    data = (root / SHARD).read_bytes()
    size = int.from_bytes(data[:8], "little")
    arrays = load(data)
    made = change(arrays.pop(name, None))
    forged = arrays if made is None else {**arrays, name: np.ascontiguousarray(made)}
    put(root, save(forged, json.loads(data[8 : 8 + size])["__metadata__"]))
    assert name in refusal(root, SHARD)


def test_points_that_are_not_finite(root):
    data = (root / SHARD).read_bytes()
    size = int.from_bytes(data[:8], "little")
    arrays = load(data)
    arrays["points"] = np.where(np.arange(len(arrays["points"])) == 70, np.nan, arrays["points"].T).T.astype(np.float32)
    put(root, save(arrays, json.loads(data[8 : 8 + size])["__metadata__"]))
    with pytest.raises(ShardError, match="of test has points that are not finite"):
        read_all(root)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("family", 5),
        ("family", [1] * 7),
        ("family", ["a"] * 7),
        ("split", "train"),
        ("first", 99),
        ("parameters", None),
        ("perturbation", {"P0": 1}),
        ("perturbation", ["P0"]),
    ],
)
def test_a_shard_whose_record_cannot_be(field, value, root):
    data = (root / SHARD).read_bytes()
    size = int.from_bytes(data[:8], "little")
    about = json.loads(json.loads(data[8 : 8 + size])["__metadata__"]["symshrec"])
    put(root, save(load(data), {"symshrec": json.dumps({**about, field: value})}))
    assert field in refusal(root, SHARD)


@pytest.mark.parametrize(
    "header",
    [
        b"[]",
        b"[" * 100_000,
        b'{"__metadata__": {}}',
        b'{"__metadata__": []}',
        b"\xff",
    ],
)
def test_a_shard_whose_header_is_none(header, root):
    put(root, struct.pack("<Q", len(header)) + header + bytes(100))
    refusal(root, SHARD)
    put(root, struct.pack("<Q", 2**63) + header)
    assert "claims" in refusal(root, SHARD)


def test_arrays_beyond_the_file(root):
    data = (root / SHARD).read_bytes()
    size = int.from_bytes(data[:8], "little")
    for entry in (
        {"dtype": "F32", "shape": [10**11, 3], "data_offsets": [0, 12 * 10**11]},
        {"dtype": "F32", "shape": [-1, 3], "data_offsets": [-12, 0]},
        {"dtype": "I32", "shape": [1, 3], "data_offsets": [0, 12]},
        {"dtype": [], "shape": 3, "data_offsets": None},
    ):
        header = json.dumps({**json.loads(data[8 : 8 + size]), "points": entry}).encode()
        put(root, struct.pack("<Q", len(header)) + header + data[8 + size :])
        assert "points" in refusal(root, SHARD)


def test_a_sidecar_with_other_counts_makes_no_manifest(root):
    wanted = (root / "manifest.json").read_text()
    record = json.loads(wanted)["shards"][0]
    (root / "manifest.json").unlink()
    wrong = ShardRecord(**{**record, "points": record["points"] + 1})
    (root / "test-00000.json").write_text(sidecar_text(wrong, request_of(CONFIG)))
    generate_dataset(CONFIG, root, workers=1, progress=False)
    assert (root / "manifest.json").read_text() == wanted


@pytest.mark.parametrize("text", ["[]", "null", "{}", '{"config": null}', '{"config": {}}', "[" * 100_000])
def test_a_request_or_sidecar_of_nonsense(text, root):
    wanted = (root / "manifest.json").read_text()
    (root / "manifest.json").unlink()
    (root / "test-00000.json").write_text(text)
    generate_dataset(CONFIG, root, workers=1, progress=False)
    assert (root / "manifest.json").read_text() == wanted
    (root / "manifest.json").unlink()
    (root / "request.json").write_text(text)
    with pytest.raises(ShardError, match=r"request\.json is not readable|holds other shards"):
        generate_dataset(CONFIG, root, workers=1, progress=False)
