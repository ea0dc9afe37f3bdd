"""Weights files that were forged or damaged: refused in a line that names the file and the field."""

import json

import pytest
import torch
from safetensors.torch import load_file, save_file

from symshrec.methods.m1.module import M1
from symshrec.methods.m1.settings import M1Settings, NetworkSettings
from symshrec.methods.settings import plain_settings
from symshrec.methods.weights import WeightsError, read_weights, shipped, write_weights

SMALL = NetworkSettings(points=16, channels=8, layers=1, features=8, hidden=(8, 8), planes=2)
NETWORK = plain_settings(SMALL)
TRAINING = {"seconds": 60.0, "epochs": 1.0, "fold": 0, "hardware": {"gpu": None, "cpu": "a"}, "data": {"name": "b"}}
ABOUT = {"format": "symshrec weights 1", "method": "m1", "network": NETWORK, "training": TRAINING}


@pytest.fixture(scope="module")
def tensors(tmp_path_factory):
    path = tmp_path_factory.mktemp("weights") / "a.safetensors"
    write_weights(path, "m1", NETWORK, TRAINING, M1(M1Settings(network=SMALL)).networks[0].state_dict())
    return load_file(path)


def refusal(path, tensors, about):
    """What is raised for a file of these tensors and this metadata."""
    texts = {key: value if isinstance(value, str) else json.dumps(value) for key, value in about.items()}
    save_file(tensors, path, metadata=texts)
    with pytest.raises(WeightsError) as error:
        M1(M1Settings(weights=[str(path)]))
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)
    assert len(str(error.value)) < 1000
    return str(error.value)


@pytest.mark.parametrize("field", ["network", "training"])
@pytest.mark.parametrize("value", ["", "{", "[]", "null", "NaN", "[" * 100_000])
def test_records_that_are_none(field, value, tensors, tmp_path):
    assert f"its {field} is" in refusal(tmp_path / "a.safetensors", tensors, {**ABOUT, field: value})


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *(("points", value) for value in (None, "x", 0, -1, 1.5, True, 10**9, 10**30)),
        *(("layers", value) for value in (10**9, 5_000, [])),
        *(("channels", value) for value in (10**9, 60_000, 6, "8")),
        *(("hidden", value) for value in (8, [8], [8, -1], [10**9, 8], ["8", "8"])),
        *(("encoder", value) for value in ("other", 3, None)),
        ("more", 1),
    ],
)
def test_networks_that_cannot_be(name, value, tensors, tmp_path):
    about = {**ABOUT, "network": {**NETWORK, name: value}}
    assert (name in refusal(tmp_path / "a.safetensors", tensors, about)) or value in (60_000, 5_000)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *(("seconds", value) for value in (None, "x", -1, 10**400, True)),
        *(("epochs", value) for value in ([], -1, 10**400)),
        *(("fold", value) for value in (None, "0", -1)),
        *(("hardware", value) for value in (None, [], {"gpu": 3}, {})),
        *(("data", value) for value in (None, {}, {"name": 3})),
    ],
)
def test_records_of_a_training_that_cannot_be(name, value, tensors, tmp_path):
    about = {**ABOUT, "training": {**TRAINING, name: value}}
    assert f"training.{name}" in refusal(tmp_path / "a.safetensors", tensors, about)


def test_tensors_that_do_not_fit(tensors, tmp_path):
    key = next(key for key, value in tensors.items() if value.ndim == 2)
    for changed, problem in (
        ({key: tensors[key] * float("nan")}, "not finite"),
        ({key: tensors[key].long()}, "torch.int64"),
        ({key: tensors[key][:1].contiguous()}, "instead of"),
        ({"more": torch.zeros(3)}, "more is left over"),
    ):
        told = refusal(tmp_path / "a.safetensors", {**tensors, **changed}, ABOUT)
        assert problem in told
    fewer = {name: value for name, value in tensors.items() if name != key}
    assert f"{key} is missing" in refusal(tmp_path / "a.safetensors", fewer, ABOUT)


def test_what_is_shipped_passes():
    assert len(shipped()) > 5
    for name in shipped():
        assert "points" in read_weights(name).about
