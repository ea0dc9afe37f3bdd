"""M2's patches, encoder, heads and masked autoencoder."""

from dataclasses import replace

import pytest
import torch
from torch.nn import functional

from symshrec.geometry.hemisphere import hemisphere_directions
from symshrec.geometry.sampling import farthest_point_sampling
from symshrec.methods.m2.autoencoder import MaskedAutoencoder, chamfer_l2
from symshrec.methods.m2.encoder import Encoder
from symshrec.methods.m2.heads import PlaneHeads, unit_planes
from symshrec.methods.m2.loss import symmetry_loss
from symshrec.methods.m2.patches import cut_patches
from symshrec.methods.m2.settings import NetworkSettings, PretrainSettings

SIZES = NetworkSettings(points=90, groups=12, neighbours=8, width=24, depth=2, heads=3)


def random_clouds(clouds=3, count=90, seed=0, dtype=torch.float32):
    points = torch.randn(clouds, count, 3, generator=torch.Generator().manual_seed(seed), dtype=dtype)
    points = points - points.mean(1, keepdim=True)
    return points / points.norm(dim=2).amax(1)[:, None, None]


def test_patches_are_the_nearest_points_of_farthest_centres():
    clouds = random_clouds(2, 50, dtype=torch.float64)
    centres, patches = cut_patches(clouds, 6, 5)
    for cloud, cloud_centres, cloud_patches in zip(clouds, centres, patches, strict=True):
        chosen = farthest_point_sampling(cloud, torch.tensor([50]), 6)[0]
        assert torch.equal(cloud_centres, cloud[chosen])
        for centre, patch in zip(cloud_centres, cloud_patches, strict=True):
            expected = (cloud - centre).norm(dim=1).sort().values[:5]
            torch.testing.assert_close(patch.norm(dim=1).sort().values, expected)
    with pytest.raises(ValueError, match=r"\(2, 50, 3\), expected .* N ≥ 51"):
        cut_patches(clouds, 6, 51)


@pytest.mark.parametrize("training", [True, False])
def test_the_order_of_the_points_changes_nothing(training):
    torch.manual_seed(0)
    encoder = Encoder(replace(SIZES, drop_path=0.0)).train(training)
    clouds = random_clouds()
    features = encoder(clouds)
    assert features.shape == (3, 48)
    shuffled = clouds[:, torch.randperm(clouds.shape[1])]
    torch.testing.assert_close(encoder(shuffled), features, rtol=1e-4, atol=1e-5)
    assert (features[0] - features[1]).abs().max() > 0.01


def test_published_sizes():
    """Point-MAE's encoder has 22 million parameters; its feature is twice the width."""
    encoder = Encoder(NetworkSettings()).eval()
    assert 21.5e6 < sum(each.numel() for each in encoder.parameters()) < 22.5e6
    first, last = (encoder.transformer.blocks[row].drop_path for row in (0, -1))
    assert first == 0
    assert last == pytest.approx(0.1)
    with torch.no_grad(), torch.autocast("cpu", dtype=torch.bfloat16):
        assert encoder(random_clouds(1, 1024)).shape == (1, 768)


@pytest.mark.parametrize(
    "size", [{"groups": 0}, {"depth": 0}, {"width": 64}, {"width": 384, "heads": 5}, {"drop_path": 1.0}]
)
def test_sizes_out_of_range_are_named(size):
    with pytest.raises(ValueError, match=next(iter(size))):
        NetworkSettings(**size)


def test_autoencoder_hides_patches_and_learns_to_tell_them():
    torch.manual_seed(0)
    autoencoder = MaskedAutoencoder(Encoder(SIZES), PretrainSettings())
    clouds = random_clouds(8)
    before = autoencoder(clouds)
    assert before.hidden.shape == before.predicted.shape == (8, 7, 8, 3)  # 0.6 of 12, rounded down
    assert before.visible.shape == (8, 5, 8, 3)
    patches = torch.cat([before.hidden, before.visible], 1).flatten(1, 2)
    assert torch.cdist(patches, clouds).amin(2).max() < 1e-3  # true patches lie on the cloud
    optimiser = torch.optim.AdamW(autoencoder.parameters(), 3e-3)
    for _ in range(30):
        loss = autoencoder(clouds).loss
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
    assert loss < 0.8 * before.loss
    unused = {name for name, each in autoencoder.named_parameters() if each.grad is None}
    assert unused == {"encoder.class_token", "encoder.class_position"}


def test_the_mask_follows_its_generator_and_the_hidden_patches_are_unseen():
    autoencoder = MaskedAutoencoder(Encoder(SIZES), PretrainSettings()).eval()
    clouds = random_clouds(1)
    first, again = (autoencoder(clouds, torch.Generator().manual_seed(5)) for _ in range(2))
    assert torch.equal(first.hidden, again.hidden)
    seen = []
    autoencoder.encoder.embedding.register_forward_hook(lambda module, given, result: seen.append(given[0]))
    answer = autoencoder(clouds, torch.Generator().manual_seed(5))
    centres = answer.visible.mean(2, keepdim=True) - seen[0].mean(2, keepdim=True)
    torch.testing.assert_close(seen[0] + centres, answer.visible)
    assert seen[0].shape[1] == 5


def test_reconstruction_loss_is_chamfer_both_ways():
    predicted, patches = random_clouds(4, 6, seed=1).view(2, 2, 6, 3), random_clouds(4, 6, seed=2).view(2, 2, 6, 3)
    squares = (predicted[..., :, None, :] - patches[..., None, :, :]).square().sum(-1)
    torch.testing.assert_close(chamfer_l2(predicted, patches), squares.amin(-1).mean() + squares.amin(-2).mean())


@pytest.mark.parametrize("ratio", [0.0, 0.05, 1.0])
def test_a_mask_of_nothing_or_everything_is_refused(ratio):
    with pytest.raises(ValueError, match="mask_ratio"):
        MaskedAutoencoder(Encoder(SIZES), PretrainSettings(mask_ratio=ratio))


def test_heads_side_by_side_are_heads_one_by_one():
    torch.manual_seed(0)
    heads, features = PlaneHeads(20, heads=5, hidden=16, dropout=0.0), torch.randn(7, 20)
    normals, offsets = heads(features)
    torch.testing.assert_close(normals.norm(dim=2), torch.ones(7, 5))
    for head in range(5):
        values = features
        for layer in (heads.first, heads.second):
            values = functional.linear(values, layer.weight[head], layer.bias[head])
            values = functional.relu(functional.batch_norm(values, None, None, training=True))
        raw = functional.linear(values, heads.third.weight[head], heads.third.bias[head])
        length = raw[:, :3].norm(dim=1, keepdim=True)
        torch.testing.assert_close(torch.cat([normals[:, head], offsets[:, head, None]], 1), raw / length)


def test_heads_start_apart_and_answer_in_full_precision():
    torch.manual_seed(0)
    with torch.autocast("cpu", dtype=torch.bfloat16):
        normals, offsets = PlaneHeads(48).eval()(torch.randn(4, 48))
    assert normals.dtype == offsets.dtype == torch.float32
    starts = torch.from_numpy(hemisphere_directions(27)).float()
    assert (normals @ starts.T).diagonal(dim1=1, dim2=2).min() > 0.9
    assert offsets.abs().max() < 0.4


def test_a_normal_without_length_is_a_plane_without_gradient():
    raw = torch.tensor([[0.0, 0, 0, 5], [1e-9, 0, 0, 1], [0, 3, 4, 10]], requires_grad=True)
    normals, offsets = unit_planes(raw)
    assert normals.tolist()[:2] == [[0, 0, 1], [0, 0, 1]]
    torch.testing.assert_close(offsets, torch.tensor([0.0, 0.0, 2.0]))
    (normals.sum() + offsets.sum()).backward()
    assert raw.grad[:2].eq(0).all()
    assert raw.grad.isfinite().all()


@pytest.mark.parametrize("argument", [{"heads": 0}, {"hidden": 0}, {"dropout": 1.0}])
def test_head_arguments_out_of_range_are_named(argument):
    with pytest.raises(ValueError, match=next(iter(argument))):
        PlaneHeads(**{"features": 48} | argument)


def test_gradient_reaches_every_part():
    torch.manual_seed(0)
    encoder = Encoder(SIZES)
    heads = PlaneHeads(2 * SIZES.width, heads=6, hidden=16)
    clouds = random_clouds(4)
    symmetry_loss(clouds, *heads(encoder(clouds)), 17.0).total.backward()
    parameters = [*encoder.named_parameters(), *heads.named_parameters()]
    assert all(each.grad is not None and each.grad.isfinite().all() for _, each in parameters)
