import math

import numpy as np
import pytest

from symshrec.metrics import match_planes, plane_errors
from symshrec.planes import PackedPlanes, Planes


def pack(*clouds):
    """Clouds given as lists of (normal, point, confidence), normals taken as they are, to the bit."""
    rows = [plane for cloud in clouds for plane in cloud]
    columns = [np.array([row[k] for row in rows], dtype=np.float64) for k in range(3)]
    starts = np.concatenate([[0], np.cumsum([len(cloud) for cloud in clouds])])
    return PackedPlanes(columns[0].reshape(-1, 3), columns[1].reshape(-1, 3), columns[2], starts)


X, Y, ORIGIN = (1, 0, 0), (0, 1, 0), (0, 0, 0)


@pytest.mark.parametrize("sign", [1, -1])
def test_angle_met_exactly_is_a_match_and_the_next_number_is_not(sign):
    cosine, sine = math.cos(math.radians(1)), math.sin(math.radians(1))
    beyond = np.nextafter(cosine, 0)
    predicted = pack([((sign * cosine, sine, 0), ORIGIN, 1)], [((sign * beyond, sine, 0), ORIGIN, 1)])
    matches = match_planes(predicted, pack([(X, ORIGIN, 1)], [(X, ORIGIN, 1)]), [1, 1], [1], [0])
    assert matches.clouds.tolist() == [0]


def test_distance_met_exactly_is_a_match_and_the_next_number_is_not():
    predicted = pack([(X, (0.5, 7, 0), 1)], [(X, (np.nextafter(0.5, 1), 7, 0), 1)])
    matches = match_planes(predicted, pack([(X, ORIGIN, 1)], [(X, ORIGIN, 1)]), [2, 2], [1], [0.25])
    assert matches.clouds.tolist() == [0]


def test_distance_is_along_the_true_normal():
    tilted = (math.cos(0.1), math.sin(0.1), 0)
    far_along_the_plane = pack([(tilted, (0, 100, 0), 1)])
    assert len(match_planes(far_along_the_plane, pack([(X, ORIGIN, 1)]), [1], [10], [0.01]).clouds)
    assert not len(match_planes(pack([(X, (0, 100, 0), 1)]), pack([(tilted, ORIGIN, 1)]), [1], [10], [0.01]).clouds)


def test_least_cost_wins_and_the_first_of_equals():
    near, nearer = (X, (0.2, 0, 0), 1), (X, (0.1, 0, 0), 1)
    both = [(X, ORIGIN, 1)] * 2
    matches = match_planes(pack(both, both[:1]), pack([near, nearer, nearer], [nearer, nearer]), [1, 1], [1], [0.5])
    assert matches.true_planes.tolist() == [1, 2, 3]
    assert matches.predictions.tolist() == [0, 1, 2]
    assert matches.ranks.tolist() == [1, 2, 1]


def test_confidence_ranks_stably_and_each_true_plane_serves_once():
    predicted = pack([(X, ORIGIN, 0.1), (X, ORIGIN, 0.9), (X, ORIGIN, 0.9), (Y, ORIGIN, -3.0)])
    matches = match_planes(predicted, pack([(X, ORIGIN, 1), (Y, ORIGIN, 1)]), [1], [1], [0.1])
    assert list(zip(matches.predictions, matches.ranks, strict=True)) == [(1, 1), (3, 4)]


def test_a_cloud_without_extent_matches_at_no_distance_alone():
    predicted = pack([(X, ORIGIN, 1)], [(X, (1e-9, 0, 0), 1)])
    matches = match_planes(predicted, pack([(X, ORIGIN, 1)], [(X, ORIGIN, 1)]), [0, 0], [1], [0.5])
    assert matches.clouds.tolist() == [0]


def test_plane_errors_are_what_was_put_in():
    rng = np.random.default_rng(0)
    angles, shares, diagonals = rng.uniform(1e-6, 5, 40), rng.uniform(0, 0.05, 40), rng.uniform(1, 9, 40)
    predicted, truth = [], []
    for angle, share, diagonal in zip(np.radians(angles), shares, diagonals, strict=True):
        frame = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        point = rng.normal(size=3)
        truth.append(Planes(frame[:1], point[None]))
        in_plane = frame[1:].T @ rng.normal(size=2)
        normal = np.cos(angle) * frame[0] + np.sin(angle) * frame[1]
        predicted.append(Planes(-normal[None], (point + share * diagonal * frame[0] + in_plane)[None]))
    errors = plane_errors(PackedPlanes.pack(predicted), PackedPlanes.pack(truth), diagonals, theta_deg=6, epsilon=0.06)
    assert errors.clouds.tolist() == list(range(40))
    np.testing.assert_allclose(errors.angles_deg, angles, rtol=1e-6)
    np.testing.assert_allclose(errors.offsets, shares, atol=1e-12)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"diagonals": [1.0]}, "2 clouds, truth of 2 and diagonals of shape \\(1,\\)"),
        ({"diagonals": [1.0, -1.0]}, "diagonals\\[1\\] is -1"),
        ({"diagonals": [np.nan, 1.0]}, "diagonals\\[0\\] is nan"),
        ({"thetas_deg": [91]}, "thetas_deg must be .* in \\[0, 90\\]"),
        ({"epsilons": []}, "epsilons must be one or more"),
        ({"epsilons": [-0.1]}, "epsilons must be"),
        ({"predicted": pack([(X, (np.nan, 0, 0), 1)], [])}, "predicted planes hold values that are not finite"),
        ({"truth": pack([((2, 0, 0), ORIGIN, 1)], [])}, "truth normals are not of unit length"),
        ({"truth": pack([])}, "truth of 1"),
    ],
)
def test_what_does_not_fit_is_refused(change, message):
    planes = pack([(X, ORIGIN, 1)], [])
    arguments = {"predicted": planes, "truth": planes, "diagonals": [1.0, 1.0], "thetas_deg": [1], "epsilons": [0.1]}
    with pytest.raises(ValueError, match=message):
        match_planes(**{**arguments, **change})
