"""M1 as a method: what neither order nor scale may change, its weights, what it learns and what it refuses."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from symshrec.data.batch import SampledBatch
from symshrec.methods.m1.module import M1
from symshrec.methods.m1.network import M1Network
from symshrec.methods.m1.settings import DecodeSettings, LossSettings, M1Settings, NetworkSettings, VectorForm
from symshrec.methods.settings import plain_settings, restored_settings
from symshrec.methods.weights import WeightsError, write_weights
from symshrec.planes import Planes, axis_angles
from tests.methods.likeness import (
    assert_blind_to_order_and_moving_with_the_cloud,
    assert_same_planes,
    stretched_cloud,
    untrained_weights,
)

SMALL = NetworkSettings(points=48, channels=16, layers=2, features=32, hidden=(24, 16), planes=4)


@pytest.fixture(scope="module")
def weights(tmp_path_factory):
    return untrained_weights(tmp_path_factory.mktemp("weights"), "m1", M1Network, SMALL)


def loose(weights):
    """A method that finds planes in whatever an untrained network says."""
    return M1(M1Settings(weights=weights, decode=DecodeSettings(confidence=0.2, eps_deg=15, separation_deg=10))).eval()


def test_planes_do_not_depend_on_order_and_move_with_the_cloud(weights):
    assert_blind_to_order_and_moving_with_the_cloud(loose(weights[:1]))


def test_a_network_twice_answers_as_once(weights):
    points = stretched_cloud()
    assert_same_planes(loose([weights[0]] * 2).detect(points), loose(weights[:1]).detect(points), atol=0.02)
    assert len(loose(weights).networks) == 2


def test_seen_twice_a_mirrored_cloud_has_mirrored_planes(weights):
    method, points, mirror = loose(weights[:1]), stretched_cloud(), np.array([1.0, -1.0, 1.0])
    method.settings = replace(method.settings, twice=True)
    planes, mirrored = method.detect(points), method.detect(points * torch.tensor([1.0, -1, 1]))
    assert_same_planes(mirrored, Planes(planes.normals * mirror, planes.points * mirror, planes.confidences))


def test_tiny_clouds_work(weights):
    for points in (torch.zeros(1, 3), torch.ones(5, 3), stretched_cloud(3)):
        planes = loose(weights[:1]).detect(points)
        assert np.isfinite(planes.points).all()


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (torch.zeros(5, 2), r"shape \(5, 2\)"),
        (torch.full((4, 3), torch.nan), "not finite"),
        (torch.zeros(0, 3), r"\(0, 3\)"),
    ],
)
def test_points_that_cannot_be_used_are_refused(weights, points, message):
    with pytest.raises(ValueError, match=message):
        loose(weights[:1]).detect(points)


def test_weights_bring_their_network_and_their_halves_suffice(weights):
    method = M1(M1Settings(weights=weights[:1]))
    assert method.network_settings == SMALL == restored_settings(NetworkSettings, plain_settings(SMALL))
    assert method.points == 48
    assert method.weights_record[0]["sha256"] == method.weights[0].sha256


def test_weights_that_do_not_fit_are_named(weights, tmp_path):
    with pytest.raises(WeightsError, match="no weights called 'm1_r9' come with symshrec; of m1 there are"):
        M1(M1Settings(weights=["m1_r9"]))
    (tmp_path / "x.safetensors").write_bytes(b"no such thing")
    with pytest.raises(WeightsError, match="not a readable safetensors file"):
        M1(M1Settings(weights=[str(tmp_path / "x.safetensors")]))
    wide = replace(SMALL, features=64)
    for name, method, message in (("y", "m2", "weights of m2, not of m1"), ("z", "m1", "do not fit the network")):
        path = tmp_path / f"{name}.safetensors"
        write_weights(path, method, plain_settings(wide), {}, M1Network(SMALL).state_dict())
        with pytest.raises(WeightsError, match=message):
            M1(M1Settings(weights=[str(path)]))
    with pytest.raises(ValueError, match=r"has no weights; name some with method\.weights, or train it first"):
        M1(M1Settings(network=SMALL)).detect(stretched_cloud())


def test_the_loss_teaches_planes():
    """Boxes turned about z, learnt by heart: their three planes come out, and the conical ones between them do not."""
    torch.manual_seed(0)
    rng = np.random.default_rng(0)
    boxes = rng.uniform(-1, 1, (16, 48, 3)) * [1.0, 0.6, 0.3]
    angles = rng.uniform(-0.7, 0.7, 16)
    zero, one = np.zeros(16), np.ones(16)
    turns = np.array(
        [[np.cos(angles), np.sin(angles), zero], [-np.sin(angles), np.cos(angles), zero], [zero, zero, one]]
    )
    turns = turns.transpose(2, 0, 1)  # (16, 3, 3), rows are the planes' normals
    truth = [Planes(turn, np.full((3, 3), 0.5)) for turn in turns]
    batch = SampledBatch.of(torch.from_numpy(boxes @ turns + 0.5).float(), truth)
    method = M1(M1Settings(network=SMALL, loss=LossSettings(form=VectorForm.sine)))
    optimiser = torch.optim.AdamW(method.parameters(), 5e-3)
    for step in range(250):
        optimiser.param_groups[0]["lr"] = 5e-3 * (1 - step / 250)
        loss = method.losses(batch)["loss"]
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
    method.eval()
    with torch.no_grad():
        found = method.detect_sampled(batch.points)
    right = [
        len(planes) == 3 and np.rad2deg(axis_angles(planes.normals, true.normals)).min(0).max() < 5
        for planes, true in zip(found, truth, strict=True)
    ]
    assert np.mean(right) > 0.8
