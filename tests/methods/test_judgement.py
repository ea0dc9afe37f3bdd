"""What M4 sees a cloud by: evened, without its floor, and a plane's support counted where it could have been seen."""

import numpy as np
import pytest
import torch

from symshrec.methods.fit.evening import evened
from symshrec.methods.fit.floor import without_floor
from symshrec.methods.fit.frame import frame_of
from symshrec.methods.fit.judgement import Judge
from symshrec.methods.fit.surface import Neighbours
from symshrec.methods.m4.pipeline import detect_planes
from symshrec.planes import Planes

SIZES = np.array([1.0, 1.6, 2.2])


def box(count=5000, seed=0):
    """Points spread evenly over the surface of a box about 0."""
    rng = np.random.default_rng(seed)
    points = rng.uniform(-0.5, 0.5, (count, 3))
    axis = rng.choice(3, count, p=(1 / SIZES) / (1 / SIZES).sum())
    points[np.arange(count), axis] = rng.choice([-0.5, 0.5], count)
    return points * SIZES


def thinned(points, ratio, way=(1.0, 0.0, 0.0), seed=0):
    """The points, `ratio` times denser at one end of the cloud than at the other; at the x axis's, or another way's."""
    heights = points @ way
    share = (heights - heights.min()) / np.ptp(heights)
    return points[np.random.default_rng(seed).random(len(points)) < ratio ** (share - 1)]


def on_a_floor(points, width=6.0, seed=0):
    """The points standing on a square floor, which is off their centre and has a corner missing."""
    rng = np.random.default_rng(seed)
    floor = rng.uniform(-0.5, 0.5, (12_000, 2))
    floor = (floor[floor @ [1.0, 0.6] < 0.45] + [0.1, 0.06]) * width
    return np.vstack([points, np.column_stack([floor, np.full(len(floor), points[:, 2].min())])])


def judge_of(points):
    frame = frame_of(points, 8192)
    everywhere = Neighbours(frame.points)
    even = evened(everywhere)
    kept = frame.points[even.rows]
    return frame, Judge(kept, even.spacing)


def judged(points, planes):
    frame, judge = judge_of(points)
    return judge(*frame.of(planes))


def found(planes, axis, angle_deg=1.0, offset=0.02):
    """The confidence of the plane through 0 across an axis; 0 where there is none."""
    near = (np.abs(planes.normals[:, axis]) > np.cos(np.deg2rad(angle_deg))) & (np.abs(planes.offsets) < offset)
    return planes.confidences[near].max(initial=0)


def test_evening_leaves_no_two_points_near_and_covers_all():
    points = torch.from_numpy(thinned(box(8000), 10)).float()
    even = evened(Neighbours(points))
    kept = points[even.rows]
    distances = torch.cdist(kept, kept).fill_diagonal_(torch.inf)
    assert distances.min() >= even.spacing
    assert torch.cdist(points, kept).min(1).values.max() <= even.spacing
    before, after = ((each[:, 0] > 0).float().mean() / (each[:, 0] < 0).float().mean() for each in (points, kept))
    assert abs(after - 1) < 0.6 * abs(before - 1)


def test_a_floor_goes_and_faces_stay():
    for points, floor in ((box(), False), (on_a_floor(box()), True), (box()[:, :] * [1, 1, 0.1], False)):
        points = points / np.sqrt(12 * points.var(0).sum())
        kept = without_floor(points, np.random.default_rng(0).permutation(points))
        assert kept[:5000].mean() > 0.75
        assert (kept[5000:].mean() < 0.05) if floor else kept.all()


def test_support_tells_symmetries_of_a_box_from_other_planes():
    planes = Planes(np.vstack([np.eye(3), [[1, 1, 0], [0.3, 1, 2]]]), np.zeros((5, 3)))
    support = judged(box(), planes)
    assert support.support[:3].min() > 0.97
    assert support.seen[:3].min() > 0.85
    assert support.value[3:].max() < 0.6 * support.value[:3].min()


def test_what_is_cut_away_is_unobserved_and_what_is_added_contradicts():
    points, across = box(8000), Planes(np.eye(3)[:1], np.zeros((1, 3)))
    rest = points[~((points[:, 0] > 0.2) & (points[:, 2] > 0.4))]  # a corner of one side is gone
    lump = np.random.default_rng(1).normal(size=(1500, 3))
    lump = 0.35 * lump / np.linalg.norm(lump, axis=1, keepdims=True) + [0.5, 0, 0]  # one side has a ball stuck on
    cut, added = (judged(each, across) for each in (rest, np.vstack([points, lump])))
    assert cut.support > 0.93
    assert cut.support > added.support + 0.02
    assert cut.seen < cut.support


def test_a_plane_that_moves_nothing_has_no_support():
    sheet = np.random.default_rng(2).uniform(-1, 1, (2000, 3)) * [1, 0.6, 0]
    judgement = judged(sheet, Planes(np.eye(3), np.zeros((3, 3))))
    assert judgement.moved[2] == 0
    assert judgement.value[2] == 0
    assert judgement.value[:2].min() > 0.8


@pytest.mark.parametrize("damage", ["gradient", "floor", "cut"])
def test_a_box_as_scanners_give_it_keeps_its_planes(damage):
    points = box(8000)
    cloud = {
        "gradient": lambda: thinned(points, 8, (1.0, 0.8, 0.6)),
        "floor": lambda: on_a_floor(points),
        "cut": lambda: points[points @ [0.2, 0.1, 1.0] < 0.8],
    }[damage]()
    planes = detect_planes(cloud)
    assert min(found(planes, 0), found(planes, 1)) > 0.5


def test_a_bite_leaves_all_three_planes_of_a_box():
    """Density alone is sure of two of them here, and the third stands close behind."""
    points = box(8000)
    away = np.linalg.norm(points - [0.5, 0.0, 0.0], axis=1)
    planes = detect_planes(points[away > np.quantile(away, 0.03)])
    assert min(found(planes, axis) for axis in range(3)) > 0.5


@pytest.mark.parametrize("seed", range(2))
def test_a_plate_on_a_floor_has_its_two_upright_planes_and_no_other(seed):
    """Plate and floor mirror in the sheet they both are; were that enough, the floor would stay and win."""
    sizes = np.array([1.0, 0.6, 0.05])
    rng = np.random.default_rng(seed)
    plate = rng.uniform(-0.5, 0.5, (6000, 3))
    axis = rng.choice(3, 6000, p=(1 / sizes) / (1 / sizes).sum())
    plate[np.arange(6000), axis] = rng.choice([-0.5, 0.5], 6000)
    planes = detect_planes(on_a_floor(plate * sizes, width=2.0))
    sure = planes.normals[planes.confidences >= 0.5]
    np.testing.assert_allclose(np.sort(np.abs(sure), axis=0), [[0, 0, 0], [1, 1, 0]], atol=0.02)
