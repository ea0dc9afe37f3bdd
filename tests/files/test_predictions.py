import numpy as np
import pytest
from safetensors.numpy import load_file, save_file

from symshrec.files.predictions import (
    FORMAT,
    DamagedPredictionsError,
    PredictionFileError,
    PredictionStore,
    _digest,
    load_metadata,
    load_predictions,
    save_predictions,
    take_clouds,
)
from symshrec.metrics import evaluate
from symshrec.planes import PackedPlanes, Planes

COUNTS = (3, 0, 5, 1, 0, 2)


def some_planes(seed=0, counts=COUNTS):
    rng = np.random.default_rng(seed)
    return [Planes(rng.normal(size=(k, 3)), rng.normal(size=(k, 3)), rng.random(k)) for k in counts]


def assert_same(packed, planes):
    expected = PackedPlanes.pack(planes)
    for name in ("normals", "points", "confidences", "starts"):
        np.testing.assert_array_equal(getattr(packed, name), getattr(expected, name))


def test_a_file_holds_every_bit_ordered_by_position(tmp_path):
    planes = some_planes()
    positions, ids = [5, 0, 3, 9, 2, 7], [50, 0, 30, 90, 20, 70]
    path = tmp_path / "new" / "predictions.safetensors"
    save_predictions(path, positions, ids, PackedPlanes.pack(planes), {"method": "M3", "data": "abc"})
    found = load_predictions(path)
    assert found.positions.tolist() == sorted(positions)
    assert found.ids.tolist() == [10 * at for at in sorted(positions)]
    assert_same(found.planes, [planes[k] for k in np.argsort(positions)])
    assert load_metadata(path) == {"method": "M3", "data": "abc"}
    assert [file.name for file in path.parent.iterdir()] == [path.name]


def test_scores_from_a_file_equal_scores_from_memory(tmp_path):
    truth = PackedPlanes.pack(some_planes(counts=[4] * 30))
    shift = 10 ** np.random.default_rng(1).uniform(-9, -1, (120, 1))
    predicted = PackedPlanes.pack(
        [Planes(each.normals + shift[:4], each.points + shift[4:8]) for each in (truth[k] for k in range(30))]
    )
    save_predictions(tmp_path / "p", range(30), range(30), predicted, {})
    sweep = np.ones(30), np.geomspace(1e-4, 10, 30), np.geomspace(1e-6, 0.05, 30)
    ours, read = evaluate(predicted, truth, *sweep), evaluate(load_predictions(tmp_path / "p").planes, truth, *sweep)
    assert 0 < ours.recall.mean() < 1
    np.testing.assert_array_equal(ours.curve, read.curve)


def test_no_clouds_and_no_planes_are_files_too(tmp_path):
    save_predictions(tmp_path / "none", [], [], PackedPlanes.pack([]), {})
    assert len(load_predictions(tmp_path / "none").planes) == 0
    save_predictions(tmp_path / "empty", [4], [4], PackedPlanes.pack([Planes.empty()]), {})
    assert load_predictions(tmp_path / "empty").planes.counts.tolist() == [0]


def test_take_clouds_in_any_order_and_again():
    planes = some_planes()
    chosen = [2, 1, 5, 2]
    assert_same(take_clouds(PackedPlanes.pack(planes), np.array(chosen)), [planes[k] for k in chosen])


@pytest.mark.parametrize(
    ("positions", "ids", "message"), [([0, 1], [0], "do not match"), ([3, 3], [0, 1], "position 3 comes twice")]
)
def test_clouds_that_do_not_add_up_are_refused(tmp_path, positions, ids, message):
    with pytest.raises(ValueError, match=message):
        save_predictions(tmp_path / "p", positions, ids, PackedPlanes.pack(some_planes(counts=[1, 2])), {})
    assert not list(tmp_path.iterdir())


def cut(path):
    path.write_bytes(path.read_bytes()[:-9])


def empty(path):
    path.write_bytes(b"")


def flip(path):
    data = bytearray(path.read_bytes())
    data[-20] ^= 1
    path.write_bytes(data)


@pytest.mark.parametrize("damage", [cut, empty, flip])
def test_damage_is_found_and_named(tmp_path, damage):
    path = tmp_path / "predictions.safetensors"
    save_predictions(path, range(6), range(6), PackedPlanes.pack(some_planes()), {})
    damage(path)
    with pytest.raises(DamagedPredictionsError, match=str(path)):
        load_predictions(path)


def test_what_is_no_predictions_file_is_named(tmp_path):
    with pytest.raises(PredictionFileError, match=r"missing\.safetensors does not exist"):
        load_predictions(tmp_path / "missing.safetensors")
    save_file({"weight": np.ones(3)}, tmp_path / "other.safetensors")
    with pytest.raises(PredictionFileError, match=r"other\.safetensors is not in the format"):
        load_predictions(tmp_path / "other.safetensors")
    bad = PackedPlanes(np.full((1, 3), np.nan), np.zeros((1, 3)), np.zeros(1), np.array([0, 1]))
    save_predictions(tmp_path / "nan.safetensors", [0], [0], bad, {})
    with pytest.raises(PredictionFileError, match=r"nan\.safetensors: normals holds values that are not finite"):
        load_predictions(tmp_path / "nan.safetensors")


def test_a_store_goes_on_where_it_was_killed(tmp_path):
    planes = some_planes()
    store = PredictionStore(tmp_path, "key")
    store.append([4, 0], [40, 0], [planes[4], planes[0]])
    assert store.append([], [], []) is None
    (tmp_path / ".part-00000001-x.safetensors.1.partial").write_bytes(b"half written when the kill came")
    again = PredictionStore(tmp_path, "key")
    assert again.done() == {0, 4}
    again.append([1, 2, 3], [10, 20, 30], PackedPlanes.pack(planes[1:4]))
    again.append([5, 4], [50, 40], [planes[5], planes[4]])
    assert store.done() == set(range(6))
    positions, ids, packed = store.collect()
    assert positions.tolist() == list(range(6))
    assert ids.tolist() == [10 * at for at in range(6)]
    assert_same(packed, planes)
    assert [(at, len(each)) for at, each in again.items()] == list(enumerate(COUNTS))


def test_one_file_is_left_and_serves_as_the_store(tmp_path):
    planes = some_planes()
    store = PredictionStore(tmp_path, "key")
    store.append(range(4), range(4), planes[:4])
    (tmp_path / ".part.1.partial").touch()
    path = store.consolidate({"method": "M3"})
    assert [file.name for file in tmp_path.iterdir()] == [path.name] == ["predictions.safetensors"]
    assert load_metadata(path) == {"method": "M3", "key": "key"}
    more = PredictionStore(tmp_path, "key")
    assert more.done() == store.done() == {0, 1, 2, 3}
    more.append([5, 4], [5, 4], [planes[5], planes[4]])
    assert_same(load_predictions(more.consolidate()).planes, planes)


@pytest.mark.parametrize("damage", [cut, empty, flip])
def test_a_damaged_part_is_named_dropped_and_predicted_again(tmp_path, damage):
    planes = some_planes()
    store = PredictionStore(tmp_path, "key")
    store.append([0, 1], [0, 1], planes[:2])
    damaged = store.append([2, 3], [2, 3], planes[2:4])
    damage(damaged)
    with pytest.warns(RuntimeWarning, match=damaged.name):
        again = PredictionStore(tmp_path, "key")
    assert again.done() == {0, 1}
    again.append([2, 3], [2, 3], planes[2:4])
    assert_same(again.collect().planes, planes[:4])


def test_no_flipped_bit_of_a_part_costs_the_other_parts(tmp_path):
    """Nor one in the metadata, such as the key, which would make the whole store another run's."""
    planes = some_planes()
    store = PredictionStore(tmp_path, "a key of some length")
    store.append([0, 1], [0, 1], planes[:2])
    part = store.append([2, 3], [2, 3], planes[2:4])
    data, rng = part.read_bytes(), np.random.default_rng(0)
    for place in [data.index(b"a key"), data.index(b"symshrec"), *rng.integers(len(data), size=60)]:
        flipped = bytearray(data)
        flipped[place] ^= 1 << int(rng.integers(8))
        part.write_bytes(flipped)
        with pytest.warns(RuntimeWarning, match=part.name):
            assert PredictionStore(tmp_path, "a key of some length").done() == {0, 1}


def test_files_whose_checksum_is_over_the_tensors_alone_are_read(tmp_path):
    """As they were written at first."""
    save_predictions(tmp_path / "p", range(6), range(6), PackedPlanes.pack(some_planes()), {"method": "M3"})
    tensors = load_file(tmp_path / "p")
    metadata = {"method": "M3", "format": FORMAT, "sha256": _digest(tensors, {})}
    save_file(tensors, tmp_path / "old", metadata)
    assert_same(load_predictions(tmp_path / "old").planes, some_planes())


def test_a_store_of_another_run_is_refused_and_left_alone(tmp_path):
    PredictionStore(tmp_path, "old").append([0], [0], some_planes()[:1])
    with pytest.raises(PredictionFileError, match=f"key old, this run's is new.*delete {tmp_path}"):
        PredictionStore(tmp_path, "new")
    assert PredictionStore(tmp_path, "old").done() == {0}
    (tmp_path / "config.yaml").touch()
    assert PredictionStore(tmp_path, "new", reset=True).done() == set()
    assert [file.name for file in tmp_path.iterdir()] == ["config.yaml"]


def test_the_format_is_plain_safetensors_at_56_bytes_a_plane(tmp_path):
    save_predictions(tmp_path / "p", [0], [0], PackedPlanes.pack(some_planes(counts=[1000])), {})
    assert set(load_file(tmp_path / "p")) == {"positions", "ids", "starts", "normals", "points", "confidences"}
    assert (tmp_path / "p").stat().st_size < 56_000 + 2_000


@pytest.mark.parametrize(
    ("name", "change", "problem"),
    [
        ("normals", lambda array: array * 0, "not of length one"),
        ("normals", lambda array: array * 7, "not of length one"),
        ("ids", lambda array: array - 1000, "negative"),
        ("positions", lambda array: array - 1000, "negative"),
        ("starts", lambda array: array[::-1], "out of order"),
        ("starts", lambda array: array + 99 * (array == array[-1]), "out of order"),
        ("points", lambda array: array * np.nan, "not finite"),
    ],
)
def test_a_forged_file_with_a_right_checksum_is_refused(name, change, problem, tmp_path):
    path = tmp_path / "p.safetensors"
    save_predictions(path, range(len(COUNTS)), range(len(COUNTS)), PackedPlanes.pack(some_planes()), {})
    arrays = load_file(path)
    arrays[name] = np.ascontiguousarray(change(arrays[name]))
    save_file(arrays, path, {"format": FORMAT, "sha256": _digest(arrays, {})})
    with pytest.raises(PredictionFileError, match=problem) as error:
        load_predictions(path)
    assert str(path) in str(error.value)
