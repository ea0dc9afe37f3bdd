"""M2's loss and cleaning against the plain versions, and what they refuse."""

import numpy as np
import pytest
import torch
from torch.nn import functional

from symshrec.benchmark.config import BenchmarkConfig
from symshrec.benchmark.surfaces import draw_shape
from symshrec.geometry.hemisphere import hemisphere_directions
from symshrec.geometry.sampling import farthest_point_sampling
from symshrec.methods.m2.chamfer import mirrored_chamfer
from symshrec.methods.m2.cleaning import clean, confidences
from symshrec.methods.m2.heads import unit_planes
from symshrec.methods.m2.loss import orthogonality, symmetry_loss
from symshrec.methods.m2.settings import CleaningSettings, Confidence
from symshrec.speed.plain import m2 as reference


def random_clouds(clouds=3, count=90, seed=0, dtype=torch.float32):
    points = torch.randn(clouds, count, 3, generator=torch.Generator().manual_seed(seed), dtype=dtype)
    points = points - points.mean(1, keepdim=True)
    return points / points.norm(dim=2).amax(1)[:, None, None]


def random_planes(clouds=3, heads=5, seed=1, dtype=torch.float32, **options):
    raw = torch.randn(clouds, heads, 4, generator=torch.Generator().manual_seed(seed), dtype=dtype)
    return raw.mul_(torch.tensor([1, 1, 1, 0.2], dtype=dtype)).requires_grad_(**options)


def chamfer_one_by_one(points, normals, offsets):
    return torch.stack([reference.mirrored_chamfer(*each) for each in zip(points, normals, offsets, strict=True)])


@pytest.mark.parametrize(("dtype", "tolerance"), [(torch.float64, 1e-10), (torch.float32, 1e-3)])
def test_chamfer_and_its_gradient_are_those_of_the_plain_version(dtype, tolerance):
    points, raw = random_clouds(dtype=dtype), random_planes(dtype=dtype)
    results = []
    for chamfer in (mirrored_chamfer, chamfer_one_by_one):
        found = chamfer(points, *unit_planes(raw))
        results.append((found, torch.autograd.grad(found.sum(), raw)[0]))
    torch.testing.assert_close(*results, rtol=tolerance, atol=tolerance)


def test_both_directions_of_an_exact_mirror_sum_to_the_same():
    """What lets one direction, doubled, stand for both."""
    points = random_clouds(1, dtype=torch.float64)[0]
    for normal, offset in zip(*(each[0] for each in unit_planes(random_planes(dtype=torch.float64))), strict=True):
        mirrored = points - 2 * (points @ normal + offset)[:, None] * normal
        squares = torch.cdist(mirrored, points).square()
        torch.testing.assert_close(squares, squares.T)  # |p′ − q| = |q′ − p|
        torch.testing.assert_close(squares.amin(0).sum(), squares.amin(1).sum())


@pytest.mark.parametrize("chunk_bytes", [0, 90 * 90 * 4 * 2, 90 * 90 * 4 * 7, 2**30])
def test_chunks_change_nothing(chunk_bytes):
    points, planes = random_clouds(), unit_planes(random_planes())
    whole = mirrored_chamfer(points, *planes)
    assert torch.equal(mirrored_chamfer(points, *planes, chunk_bytes=chunk_bytes), whole)


def test_queries_estimate_the_sum_over_all_points_without_bias():
    points, planes = random_clouds(2, 60, dtype=torch.float64), unit_planes(random_planes(2, dtype=torch.float64))
    whole = mirrored_chamfer(points, *planes)
    parts = torch.randperm(60, generator=torch.Generator().manual_seed(0)).split(15)
    estimates = torch.stack([mirrored_chamfer(points, *planes, queries=part) for part in parts])
    assert (estimates - whole).abs().max() > 0.01
    torch.testing.assert_close(estimates.mean(0), whole)


def test_chamfer_and_regularisation_keep_full_precision_under_autocast():
    points, raw = random_clouds(), random_planes()
    expected = symmetry_loss(points, *unit_planes(raw), 17.0).total
    with torch.autocast("cpu", dtype=torch.bfloat16):
        assert torch.equal(symmetry_loss(points, *unit_planes(raw), 17.0).total, expected)


@pytest.fixture(scope="module", params=[256, 1024])
def petals(request):
    """A clean generated petal cone of so many points as M2 sees it, and the normals of its true planes."""
    shape = draw_shape("geometric_petal", np.random.default_rng(3), BenchmarkConfig())
    points = torch.from_numpy(shape.surface.points(shape.chart)).float()
    points = points[farthest_point_sampling(points, torch.tensor([len(points)]), request.param)[0]]
    points = points - points.mean(0)
    return points / points.norm(dim=1).max(), torch.tensor(shape.planes.normals).float()


def through_centre(points, normals):
    return mirrored_chamfer(points[None], normals[None], normals.new_zeros(1, len(normals)))[0]


def test_a_true_plane_costs_less_than_the_limit_and_a_wrong_one_much_more(petals):
    points, normals = petals
    angle = torch.deg2rad(torch.tensor(5.0))
    aside = functional.normalize(torch.linalg.cross(normals, normals.roll(1, 1)), dim=1)
    true = through_centre(points, normals)
    near = through_centre(points, normals * angle.cos() + aside * angle.sin())
    wrong = through_centre(points, torch.from_numpy(hemisphere_directions(27)).float()).median()
    limit = CleaningSettings().limit_at(len(points))
    assert true.max() < limit < 2 * limit < wrong
    assert (near > 1.5 * true).all()


def test_loss_is_the_plain_one_averaged_over_clouds():
    points, raw = random_clouds(dtype=torch.float64), random_planes(dtype=torch.float64)
    normals, offsets = unit_planes(raw)
    loss = symmetry_loss(points, normals, offsets, 17.0)
    plain = [reference.symmetry_loss(*each) for each in zip(points, normals, offsets, strict=True)]
    torch.testing.assert_close(loss.total, torch.stack(plain).mean())
    torch.testing.assert_close(loss.total, loss.symmetry + 17 * loss.regularisation)
    torch.testing.assert_close(loss.symmetry, loss.chamfer.sum(1).mean())


def test_the_floor_of_the_regularisation_is_216():
    axes = torch.eye(3, dtype=torch.float64).repeat(9, 1)[None]
    torch.testing.assert_close(orthogonality(axes), torch.tensor([216.0], dtype=torch.float64))
    random = functional.normalize(torch.randn(200, 27, 3, generator=torch.Generator().manual_seed(0)), dim=2)
    assert (orthogonality(random) > 216).all()
    torch.testing.assert_close(orthogonality(torch.eye(3)[:1].repeat(1, 27, 1)), torch.tensor([27.0**2 - 27]))


def test_orthogonality_pulls_on_unit_normals_alone():
    one = torch.eye(3)[None]
    assert orthogonality(one).item() == 0
    torch.testing.assert_close(orthogonality(2 * one), torch.tensor([27.0]))


@pytest.mark.parametrize(
    ("shapes", "message"),
    [
        (((2, 9, 2), (2, 4, 3), (2, 4)), "points are"),
        (((2, 0, 3), (2, 4, 3), (2, 4)), "points are"),
        (((2, 9, 3), (1, 4, 3), (1, 4)), "normals"),
        (((2, 9, 3), (2, 4, 3), (2, 5)), "offsets"),
        (((2, 9, 3), (2, 0, 3), (2, 0)), "H ≥ 1"),
    ],
)
def test_shapes_that_do_not_fit_are_named(shapes, message):
    with pytest.raises(ValueError, match=message):
        mirrored_chamfer(*(torch.zeros(shape) for shape in shapes))


def test_points_of_half_precision_are_refused():
    with pytest.raises(ValueError, match="bfloat16"):
        mirrored_chamfer(torch.zeros(1, 5, 3, dtype=torch.bfloat16), torch.zeros(1, 2, 3), torch.zeros(1, 2))


@pytest.mark.parametrize("seed", range(30))
def test_cleaning_is_that_of_the_plain_version(seed):
    rng = np.random.default_rng(seed)
    truths = rng.normal(size=(1 + seed % 5, 3))
    normals = truths[rng.integers(0, len(truths), 27)] * rng.choice([-1, 1], (27, 1))
    normals = normals + rng.choice([0.1, 1.0]) * rng.normal(size=(27, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    losses = rng.choice([4.0, 9.0, 30.0], 27) * rng.uniform(0.8, 1.25, 27)
    assert clean(normals, losses).tolist() == reference.clean(normals, losses)


def turned(degrees):
    angles = np.deg2rad(degrees)
    return np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)


def test_merging_takes_the_lowest_loss_first_and_follows_no_chain():
    """At 0°, 15° and 30° the first and last are further apart than 18°; the middle one is merged into the best."""
    assert clean(turned([0, 15, 30]), np.array([3.0, 2.0, 1.0])).tolist() == [2, 0]
    assert clean(turned([0, 15, 30]), np.array([3.0, 1.0, 2.0])).tolist() == [1]
    assert clean(turned([0, 190, 90]), np.array([2.0, 1.0, 3.0])).tolist() == [1, 2]  # 190° is 10° the other way round


def test_a_plane_goes_only_if_it_is_both_above_the_limit_and_above_the_mean():
    normals = turned([0, 60, 120])
    assert clean(normals, np.array([4.0, 5.0, 40.0])).tolist() == [0, 1]  # mean 16.3
    assert clean(normals, np.array([1.0, 1.0, 6.9])).tolist() == [0, 1, 2]  # over 1.35 × 3, not over 7
    assert clean(normals, np.array([40.0, 42.0, 44.0])).tolist() == [0, 1, 2]  # none stands out: all stay, as published
    assert clean(normals, np.array([4.0, 5.0, 6.9]), CleaningSettings(mean_factor=0, loss_limit=4.5)).tolist() == [0]


def test_cleaning_refuses_what_it_cannot_judge_and_takes_nothing_at_all():
    assert clean(np.zeros((0, 3)), np.zeros(0)).tolist() == []
    with pytest.raises(ValueError, match=r"\(2, 3\).*\(3,\)"):
        clean(np.ones((2, 3)), np.ones(3))
    with pytest.raises(ValueError, match="loss 1 is not finite"):
        clean(turned([0, 60]), np.array([1.0, np.nan]))


@pytest.mark.parametrize("setting", [{"merge_rad": 2.0}, {"mean_factor": -1.0}, {"loss_limit": float("nan")}])
def test_cleaning_settings_out_of_range_are_named(setting):
    with pytest.raises(ValueError, match=next(iter(setting))):
        CleaningSettings(**setting)


def test_confidences():
    losses = np.array([0.0, 3.0, 7.0, 500.0])
    assert confidences(losses, Confidence.none, 7.0).tolist() == [1, 1, 1, 1]
    graded = confidences(losses, Confidence.loss, 7.0)
    assert (np.diff(graded) < 0).all()
    assert graded[0] == 1
    assert graded[2] == 0.5
    assert graded[3] > 0
