"""M2 as a method: what neither order nor scale may change, its confidences, what it learns and what it refuses."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from symshrec.data.batch import SampledBatch
from symshrec.geometry.unit_sphere import UnitSphere
from symshrec.methods.m2.module import M2
from symshrec.methods.m2.network import M2Network
from symshrec.methods.m2.pretraining import M2Pretraining
from symshrec.methods.m2.settings import (
    CleaningSettings,
    Confidence,
    LossSettings,
    M2Settings,
    NetworkSettings,
    PretrainSettings,
)
from symshrec.methods.settings import plain_settings, restored_settings
from symshrec.methods.weights import WeightsError, write_weights
from symshrec.planes import axis_angles
from symshrec.speed.plain import m2 as reference
from tests.methods.likeness import (
    assert_blind_to_order_and_moving_with_the_cloud,
    assert_same_planes,
    stretched_cloud,
    untrained_weights,
)

SMALL = NetworkSettings(points=48, groups=8, neighbours=8, width=24, depth=2, heads=2, planes=9, hidden=16)
LOOSE = CleaningSettings(merge_rad=0.1, loss_limit=1e6)  # keeps whatever an untrained network says


@pytest.fixture(scope="module")
def weights(tmp_path_factory):
    return untrained_weights(tmp_path_factory.mktemp("weights"), "m2", M2Network, SMALL)


def loaded(weights, **options):
    return M2(M2Settings(weights=weights, **{"cleaning": LOOSE} | options)).eval()


def test_planes_do_not_depend_on_order_and_move_with_the_cloud(weights):
    assert_blind_to_order_and_moving_with_the_cloud(loaded(weights[:1], confidence=Confidence.loss))


def test_confidences_are_one_or_fall_with_the_loss_that_the_plain_version_gives(weights):
    points = stretched_cloud(48)
    sphere = UnitSphere.of(points[None]).apply(points[None])[0].double()
    published, graded = (loaded(weights[:1], confidence=each).detect(points) for each in Confidence)
    assert published.confidences.tolist() == [1.0] * len(published)
    by_loss = np.lexsort(graded.normals.T)
    np.testing.assert_array_equal(published.normals[np.lexsort(published.normals.T)], graded.normals[by_loss])
    assert (published.normals != graded.normals).any()  # by head: the order tells nothing of the loss
    assert (np.diff(graded.confidences) < 0).all()  # in ascending order of the loss
    heights = torch.from_numpy(np.einsum("kd,kd->k", graded.points - points.mean(0).numpy(), graded.normals))
    offsets = -heights / (points - points.mean(0)).norm(dim=1).max()
    losses = reference.mirrored_chamfer(sphere, torch.from_numpy(graded.normals), offsets)
    np.testing.assert_allclose(graded.confidences, 1 / (1 + losses.numpy() / LOOSE.limit_at(48)), rtol=1e-6)


def test_a_network_twice_answers_as_once_and_two_are_cleaned_together(weights):
    points = stretched_cloud()
    once = loaded(weights[:1]).detect(points)
    assert_same_planes(loaded([weights[0]] * 2).detect(points), once)
    both = loaded(weights, cleaning=replace(LOOSE, merge_rad=0.0)).detect(points)
    assert len(both) == 2 * SMALL.planes


def test_a_step_of_training_draws_its_points_and_validation_takes_all():
    torch.manual_seed(0)
    method = M2(M2Settings(network=replace(SMALL, dropout=0.0, drop_path=0.0), loss=LossSettings(queries=8)))
    batch = SampledBatch.of(torch.randn(4, 48, 3), [None] * 4)
    first, second = (method.train().losses(batch)["symmetry"].item() for _ in range(2))
    assert first != second
    found = method.eval().losses(batch)
    assert found["symmetry"].item() == method.losses(batch)["symmetry"].item()
    torch.testing.assert_close(found["loss"], found["symmetry"] + 17 * found["regularisation"])


def test_the_loss_teaches_planes_without_truth():
    """Long boxes turned about z, seen again and again: their planes come out among those of the heads."""
    torch.manual_seed(0)
    rng = np.random.default_rng(0)
    boxes, angles = rng.uniform(-1, 1, (16, 48, 3)) * [1.0, 0.4, 0.1], rng.uniform(-0.7, 0.7, 16)
    boxes = np.concatenate([boxes[:, :24], boxes[:, :24] * [1, -1, 1]], 1)
    zero, one = np.zeros(16), np.ones(16)
    turns = np.array(
        [[np.cos(angles), np.sin(angles), zero], [-np.sin(angles), np.cos(angles), zero], [zero, zero, one]]
    ).transpose(2, 0, 1)  # (16, 3, 3), rows are the boxes' axes
    batch = SampledBatch.of(torch.from_numpy(boxes @ turns + 0.5).float(), [None] * 16)
    method = M2(M2Settings(network=replace(SMALL, dropout=0.0, drop_path=0.0), loss=LossSettings(regularisation=0.1)))
    optimiser = torch.optim.AdamW(method.parameters(), 5e-3)
    for step in range(150):
        optimiser.param_groups[0]["lr"] = 5e-3 * (1 - step / 150)
        loss = method.losses(batch)["loss"]
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
    method.eval()
    with torch.no_grad():
        found = method.detect_sampled(batch.points)
    off = [axis_angles(planes.normals, turn[1:2]).min() for planes, turn in zip(found, turns, strict=True)]
    assert np.rad2deg(np.median(off)) < 3


def test_tiny_clouds_work(weights):
    for points in (torch.zeros(1, 3), torch.ones(5, 3), stretched_cloud(3)):
        planes = loaded(weights[:1]).detect(points)
        assert np.isfinite(planes.points).all()


def test_weights_bring_their_network(weights, tmp_path):
    assert loaded(weights[:1]).network_settings == SMALL
    assert restored_settings(NetworkSettings, plain_settings(SMALL)) == SMALL
    with pytest.raises(WeightsError, match="no weights called 'm2_r9' come with symshrec; of m2 there are"):
        M2(M2Settings(weights=["m2_r9"]))
    write_weights(tmp_path / "m1.safetensors", "m1", plain_settings(SMALL), {}, M2Network(SMALL).state_dict())
    with pytest.raises(WeightsError, match="holds weights of m1, not of m2 or m2_pretrain"):
        M2(M2Settings(network=SMALL)).start_from(str(tmp_path / "m1.safetensors"))
    with pytest.raises(ValueError, match=r"m2 has no weights; name some with method\.weights, or train it first"):
        M2(M2Settings(network=SMALL)).detect(stretched_cloud())


def test_a_training_goes_on_from_an_earlier_one(weights):
    method = M2(M2Settings(network=SMALL))
    method.start_from(weights[0])
    expected = loaded(weights[:1]).networks.state_dict()
    assert all(torch.equal(tensor, expected[name]) for name, tensor in method.networks.state_dict().items())


def test_a_pre_training_finds_no_planes():
    method = M2Pretraining(M2Settings(network=SMALL))
    with pytest.raises(ValueError, match=r"train M2 from its weights with run=m2 train\.init=FILE"):
        method.detect_sampled(torch.zeros(1, 48, 3))
    with pytest.raises(ValueError, match=r"pretrain\.mask_ratio is 0\.1, which hides 0 of 8 patches"):
        M2Pretraining(M2Settings(network=SMALL, pretrain=PretrainSettings(mask_ratio=0.1)))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: NetworkSettings(points=16), "network.groups is 64; there are only 16 points"),
        (lambda: NetworkSettings(width=100), "network.width is 100; it must be a multiple of 3 and of the 6 heads"),
        (lambda: NetworkSettings(dropout=1.0), "network.dropout is 1.0"),
        (lambda: LossSettings(regularisation=-1), "loss.regularisation is -1"),
        (lambda: LossSettings(queries=0), "loss.queries is 0"),
        (lambda: PretrainSettings(mask_ratio=1.0), "pretrain.mask_ratio is 1.0"),
        (lambda: PretrainSettings(decoder_depth=0), "pretrain.decoder_depth is 0"),
    ],
)
def test_settings_out_of_range_are_named(make, message):
    with pytest.raises(ValueError, match=message):
        make()
