"""M1's parts: the loss against every assignment, DBSCAN against scikit-learn's, what order must not change."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
import torch
from sklearn.cluster import DBSCAN

from symshrec.data.batch import SampledBatch
from symshrec.methods.m1.decode import dbscan, decode
from symshrec.methods.m1.loss import m1_losses
from symshrec.methods.m1.network import Dense, M1Network, OffsetAttention
from symshrec.methods.m1.settings import DecodeSettings, Encoder, LossSettings, NetworkSettings, VectorForm
from symshrec.planes import Planes, axis_angles
from symshrec.speed.plain.m1 import PlainPCT, plain_decode, plain_loss
from tests.methods.likeness import assert_same_planes

SMALL = NetworkSettings(points=48, channels=16, layers=2, features=32, hidden=(24, 16), planes=4)


def unit(*shape, seed=0):
    vectors = np.random.default_rng(seed).normal(size=(*shape, 3))
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def random_case(clouds=3, points=6, heads=4, counts=(3, 1, 2), seed=0):
    """What a network might say of clouds on the unit sphere, and what is true of them."""
    rng = np.random.default_rng(seed)
    dense = Dense(
        *(torch.from_numpy(rng.normal(size=(clouds, points, *shape))) for shape in ((heads, 3), (heads,), (3,)))
    )
    normals = torch.from_numpy(unit(clouds, max(counts), seed=seed + 1))
    for row, count in enumerate(counts):
        normals[row, count:] = 0
    centres, seen = (torch.from_numpy(0.3 * rng.normal(size=shape)) for shape in ((clouds, 3), (clouds, points, 3)))
    return dense, seen, normals, torch.tensor(counts), centres


def plain_cloud_loss(cloud, settings):
    """Of one cloud, the cheapest sum of vector and reflection terms over all assignments, each point on its own."""
    vectors, points, normals, centre = (np.asarray(each) for each in cloud)
    heads, planes = vectors.shape[1], len(normals)
    charge = np.zeros((heads, planes))
    for (p, point), head, plane in itertools.product(enumerate(points), range(heads), range(planes)):
        vector, normal = vectors[p, head], normals[plane]
        sine2 = 1 - (vector @ normal / np.linalg.norm(vector)) ** 2
        foot = -((point - centre) @ normal) * normal
        gap = np.linalg.norm(vector - foot)
        term = settings.vector * (sine2 if settings.form is VectorForm.squared else np.sqrt(sine2 + 1e-6))
        charge[head, plane] += term + settings.reflection * gap / np.linalg.norm(vector) + settings.foot * gap
    charge /= len(points)
    size = min(heads, planes)
    sums = []
    for chosen in itertools.permutations(range(heads), size):
        for kept in itertools.combinations(range(planes), size):
            sums.append(charge[list(chosen), list(kept)].sum() / size)
    return min(sums)


@pytest.mark.parametrize(
    "settings",
    [
        LossSettings(match_confidence=0),
        LossSettings(match_confidence=0, form=VectorForm.sine),
        LossSettings(match_confidence=0, vector=0, reflection=1),
        LossSettings(match_confidence=0, vector=0.5, reflection=2, foot=3),
    ],
    ids=["Eq. 3", "sine", "reflection", "both"],
)
@pytest.mark.parametrize("counts", [(3, 1, 2), (5, 4, 1)], ids=["fewer planes than heads", "more"])
def test_the_loss_is_the_least_over_all_assignments(settings, counts):
    dense, points, normals, truth_counts, centres = random_case(counts=counts)
    losses = m1_losses(dense, points, normals, truth_counts, centres, settings)
    found = sum(getattr(settings, name) * losses[name] for name in ("vector", "reflection", "foot") if name in losses)
    clouds = zip(dense.vectors, points, normals, counts, centres, strict=True)
    expected = [plain_cloud_loss((v, p, n[:count], c), settings) for v, p, n, count, c in clouds]
    assert float(found) == pytest.approx(np.mean(expected), rel=1e-6)


def test_without_true_planes_only_the_confidences_are_charged():
    dense, points, normals, _, centres = random_case(counts=(2, 2, 2))
    dense = Dense(*(each.requires_grad_() for each in dense))
    losses = m1_losses(dense, points, 0 * normals, torch.zeros(3, dtype=torch.int64), centres, LossSettings())
    assert (losses["vector"].item(), losses["centre"].item()) == (0, 0)
    losses["loss"].backward()
    assert dense.logits.grad.min() > 0
    assert all(each.grad is None or each.grad.isfinite().all() for each in dense)


def test_the_label_of_a_head_is_whether_it_was_matched():
    dense, points, normals, counts, centres = random_case(counts=(2, 2, 2))
    normals = dense.normals.mean(1)[:, [3, 1]]
    normals = normals / normals.norm(dim=-1, keepdim=True)
    right = dense._replace(
        vectors=torch.cat(
            [unit_rows(dense.vectors, 0), normals[:, 1:], unit_rows(dense.vectors, 2), normals[:, :1]], 1
        )[:, None].expand(-1, 6, -1, -1),
        logits=torch.tensor([-20.0, 20, -20, 20]).expand(3, 6, 4).double(),
    )
    losses = m1_losses(right, points, normals, counts, centres, LossSettings())
    assert float(losses["confidence"]) < 1e-6
    assert float(losses["vector"]) < 1e-6


def unit_rows(vectors, head):
    """(B, 1, 3): what the first point of every cloud says with one head, of length one."""
    return torch.nn.functional.normalize(vectors[:, :1, head], dim=-1)


def test_offset_attention_is_that_of_the_paper():
    torch.manual_seed(0)
    layer, x = OffsetAttention(16).eval(), torch.randn(2, 10, 16)
    q, v = layer.query(x), layer.value(x)
    weights = (q @ q.transpose(1, 2)).softmax(-1)
    weights = weights / (1e-9 + weights.sum(1, keepdim=True))
    expected = x + layer.transform(x - weights.transpose(1, 2) @ v)
    torch.testing.assert_close(layer(x), expected, rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("encoder", list(Encoder))
def test_points_in_another_order_say_the_same(encoder):
    torch.manual_seed(0)
    network = M1Network(replace(SMALL, encoder=encoder)).eval()
    points, order = torch.randn(2, 48, 3), torch.randperm(48)
    straight, shuffled = network(points), network(points[:, order])
    some = network(points, order[:5])
    for one, other, few in zip(straight, shuffled, some, strict=True):
        torch.testing.assert_close(one[:, order], other, rtol=1e-4, atol=1e-5)
        torch.testing.assert_close(one[:, order[:5]], few, rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("seed", range(5))
def test_clusters_are_those_of_scikit_learn(seed):
    rng = np.random.default_rng(seed)
    centres = unit(4, seed=seed)
    normals = centres[rng.integers(4, size=300)] + rng.normal(size=(300, 3)) * rng.choice([0.02, 0.06, 0.5], (300, 1))
    normals = rng.choice([-1, 1], (300, 1)) * normals / np.linalg.norm(normals, axis=1, keepdims=True)
    closeness = np.cos(np.deg2rad(3))
    distances = 1 - np.abs(normals @ normals.T)
    expected = DBSCAN(eps=1 - closeness, min_samples=8, metric="precomputed").fit(distances.clip(0)).labels_
    found = dbscan(normals, closeness, 8)
    near = np.abs(normals @ normals.T) >= closeness
    core = near.sum(1) >= 8  # a border point within reach of two clusters may go to either
    assert found.max() == expected.max() >= 3
    np.testing.assert_array_equal(found == -1, expected == -1)
    pairs = set(zip(found[core].tolist(), expected[core].tolist(), strict=True))
    assert len(pairs) == len(set(found[core].tolist())) == len(set(expected[core].tolist()))


def said_by_points(planes, spread_deg, count=200, heads=6, seed=0):
    """What points would say of these planes with a scatter in angle: normals with either sign, confidences, centres."""
    rng = np.random.default_rng(seed)
    normals = unit(count, heads, seed=seed)
    scatter = np.deg2rad(spread_deg) * rng.normal(size=(count, len(planes), 3))
    normals[:, : len(planes)] = (planes.normals + scatter) * rng.choice([-1, 1], (count, len(planes), 1))
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    confidences = np.full((count, heads), 0.02)
    confidences[:, : len(planes)] = planes.confidences
    return normals, confidences, planes.points[0] + 0.01 * rng.normal(size=(count, 3))


def test_planes_are_means_of_what_the_points_say():
    true = Planes(unit(3, seed=4), np.full((3, 3), 0.1), np.array([0.9, 0.7, 0.8]))
    found = decode(*said_by_points(true, 1.0), DecodeSettings(agreement_deg=30))
    assert len(found) == 3
    np.testing.assert_allclose(found.confidences, [0.9, 0.8, 0.7], atol=0.02)
    halved = decode(*said_by_points(true, 1.0), DecodeSettings())  # the mean of exp(−θ²/2σ²) where both spreads are σ
    np.testing.assert_allclose(halved.confidences, found.confidences / 2, rtol=0.1)
    assert np.rad2deg(axis_angles(found.normals, true.normals)).min(0).max() < 0.3
    np.testing.assert_allclose(found.points, 0.1, atol=0.005)


def test_of_two_close_planes_the_more_confident_stays():
    angle = np.deg2rad(4)
    close = Planes(np.array([[1, 0, 0], [np.cos(angle), np.sin(angle), 0]]), np.zeros((2, 3)), np.array([0.6, 0.9]))
    settings = DecodeSettings(eps_deg=1)
    found = decode(*said_by_points(close, 0.1), settings)
    assert np.rad2deg(axis_angles(found.normals, close.normals))[0].tolist() == pytest.approx([4, 0], abs=0.1)
    both = decode(*said_by_points(close, 0.1), DecodeSettings(eps_deg=1, separation_deg=3))
    assert len(both) == 2


def test_nothing_confident_gives_no_plane():
    true = Planes(unit(2), np.zeros((2, 3)), np.array([0.1, 0.2]))
    assert len(decode(*said_by_points(true, 1.0), DecodeSettings())) == 0


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: NetworkSettings(channels=30), "channels is 30; it must be a multiple of 4"),
        (lambda: NetworkSettings(points=0), "points is 0"),
        (lambda: NetworkSettings(hidden=(1, 2, 3)), "hidden"),
        (lambda: LossSettings(vector=0), "loss.vector, loss.reflection and loss.foot are all 0"),
        (lambda: LossSettings(centre=-1), "loss.centre is -1"),
        (lambda: DecodeSettings(eps_deg=91), "decode.eps_deg is 91"),
        (lambda: DecodeSettings(cluster_points=0), "cluster_points is 0"),
    ],
)
def test_settings_out_of_range_are_named(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_a_turned_batch_has_its_planes_turned_with_it():
    planes = [Planes(unit(2), np.full((2, 3), 0.2)), None]
    batch = SampledBatch.of(torch.randn(2, 30, 3), planes)
    turned = batch.turned()
    heights, after = (
        torch.einsum("bnd,bkd->bnk", each.points - each.centres[:, None], each.normals) for each in (batch, turned)
    )
    torch.testing.assert_close(heights, after, rtol=1e-4, atol=1e-5)
    assert (turned.points - batch.points).abs().max() > 0.1
    assert turned.counts.tolist() == [2, 0]


def test_the_plain_version_says_charges_and_decodes_the_same():
    torch.manual_seed(0)
    network = M1Network(SMALL)
    network.train()(torch.randn(64, 48, 3))
    network.eval()
    points, (normals, centres) = torch.randn(2, 48, 3), (torch.zeros(2, 3, 3), torch.randn(2, 3))
    normals[0], normals[1, :2] = torch.eye(3), torch.eye(3)[1:]
    dense, plain_network, counts = network(points), PlainPCT(network), torch.tensor([3, 2])
    said = [plain_network(cloud) for cloud in points]
    for row, (axes, logits, where) in enumerate(said):
        torch.testing.assert_close(axes, dense.normals[row], rtol=1e-3, atol=1e-4)
        torch.testing.assert_close(logits, dense.logits[row], rtol=1e-3, atol=1e-4)
        torch.testing.assert_close(where, dense.centres[row], rtol=1e-3, atol=1e-4)
    ours = m1_losses(dense, points, normals, counts, centres, LossSettings(match_confidence=0))["loss"]
    plainly = [plain_loss(*each) for each in zip(said, (normals[0], normals[1, :2]), centres, strict=True)]
    assert ours.item() == pytest.approx(sum(each.item() for each in plainly) / 2, rel=1e-4)
    true = Planes(np.eye(3), np.full((3, 3), 0.1), np.array([0.9, 0.8, 0.7]))
    everything = said_by_points(true, 0.5)
    found, plainly = decode(*everything, DecodeSettings(cluster_points=200)), plain_decode(*everything)
    assert_same_planes(found, plainly, atol=1e-6)
