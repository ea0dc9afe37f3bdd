import numpy as np
import pytest

from symshrec.benchmark.cloud import UNKNOWN, Labels
from symshrec.metrics import METRICS, evaluate, group_masks, grouped, matching, scores
from symshrec.planes import PackedPlanes, Planes
from symshrec.speed.plain.metrics import evaluate_plainly, score_plainly

PER_CLOUD = ("average_precision", "recall_aware_ap", "phc", "recall", "curve")


def random_clouds(seed, clouds=60):
    """Predictions scattered from far to hair-near around the true planes, in any order and sign."""
    rng = np.random.default_rng(seed)
    predicted, truth = [], []
    for _ in range(clouds):
        count, guesses = rng.integers(1, 9), rng.integers(0, 14)
        true = Planes(rng.normal(size=(count, 3)), np.tile(rng.normal(size=3), (count, 1)))
        chosen, scale = rng.integers(0, count, guesses), 10 ** rng.uniform(-4, 0, (guesses, 1))
        normals = (true.normals[chosen] + scale * rng.normal(size=(guesses, 3))) * rng.choice([-1, 1], (guesses, 1))
        points = true.points[chosen] + scale * rng.normal(size=(guesses, 3))
        predicted.append(Planes(normals, points, rng.random(guesses)))
        truth.append(true)
    return predicted, truth, rng.uniform(1, 5, clouds)


def adversarial_clouds(seed, clouds=150):
    """A few directions, places and confidences, so that ties, duplicates and thresholds met exactly are the rule."""
    rng = np.random.default_rng(seed)
    directions = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [1, 0, 1], [1, 1, 1], [1, 0.01, 0]])

    def draw(most):
        count = rng.integers(0, most)
        normals = directions[rng.integers(0, len(directions), count)] * rng.choice([-1, 1], (count, 1))
        return Planes(normals, rng.integers(-2, 3, (count, 3)) / 4, rng.integers(0, 3, count) / 2)

    return [draw(9) for _ in range(clouds)], [draw(5) for _ in range(clouds)], rng.choice([1.0, 2.0, 4.0], clouds)


@pytest.mark.parametrize("clouds", [random_clouds(1), adversarial_clouds(2), random_clouds(3, clouds=1)])
@pytest.mark.parametrize("curves", [True, False])
def test_equals_the_plain_reference_at_every_tolerance(clouds, curves):
    predicted, truth, diagonals = clouds
    thetas, epsilons = [45, 0, 1, 90, 0.05], [0.125, 0.01, 0.25, 0]
    found = evaluate(PackedPlanes.pack(predicted), PackedPlanes.pack(truth), diagonals, thetas, epsilons, curves=curves)
    with_truth = found.true_counts > 0
    for (row, theta), (column, epsilon) in [(t, e) for t in enumerate(thetas) for e in enumerate(epsilons)]:
        expected = evaluate_plainly(predicted, truth, diagonals, theta, epsilon)
        for name in PER_CLOUD if curves else PER_CLOUD[:-1]:
            mask = with_truth if name in ("recall_aware_ap", "recall") else slice(None)
            ours = getattr(found, name)[row, column]
            np.testing.assert_allclose(
                ours[mask], expected[name][mask], rtol=1e-14, err_msg=f"{name} {theta} {epsilon}"
            )


def test_a_sweep_is_the_single_evaluations_side_by_side():
    predicted, truth, diagonals = random_clouds(4)
    packed = PackedPlanes.pack(predicted), PackedPlanes.pack(truth)
    thetas, epsilons = np.geomspace(10, 0.05, 10), np.geomspace(0.0005, 0.05, 10)
    sweep = evaluate(*packed, diagonals, thetas, epsilons)
    for row, column in [(0, 0), (0, 9), (5, 5), (6, 4), (9, 9)]:
        single = evaluate(*packed, diagonals, thetas[row], epsilons[column])
        for name in PER_CLOUD:
            np.testing.assert_array_equal(getattr(sweep, name)[row, column], getattr(single, name)[0, 0])


def test_chunks_change_nothing(monkeypatch):
    predicted, truth, diagonals = adversarial_clouds(5)
    packed = PackedPlanes.pack(predicted), PackedPlanes.pack(truth)
    whole = evaluate(*packed, diagonals, [1, 45], [0.1, 0.25])
    monkeypatch.setattr(matching, "PAIRS_PER_CHUNK", 7)
    monkeypatch.setattr(scores, "CELLS_PER_CHUNK", 9)
    pieces = evaluate(*packed, diagonals, [1, 45], [0.1, 0.25])
    for name in PER_CLOUD:
        np.testing.assert_array_equal(getattr(whole, name), getattr(pieces, name))


def ranked_hits(hits, true_count):
    """One cloud of `true_count` parallel planes whose k-th ranked prediction is right where hits[k]."""
    axis, places = [[1.0, 0, 0]], np.arange(true_count)[:, None] * [[1.0, 0, 0]]
    right = np.cumsum(hits) - 1
    points = np.array([[at if hit else 500.0, 0, 0] for hit, at in zip(hits, right, strict=True)]).reshape(-1, 3)
    predicted = Planes(np.repeat(axis, len(hits), 0), points, np.arange(len(hits), 0, -1.0))
    return PackedPlanes.pack([predicted]), PackedPlanes.pack([Planes(np.repeat(axis, true_count, 0), places)])


def test_the_organisers_quirks_by_hand():
    found = evaluate(*ranked_hits([0, 1, 1, 0, 1], true_count=4), [1.0])
    assert found.average_precision.item() == pytest.approx((1 / 2 + 2 / 3 + 3 / 5) / 3)
    assert found.recall_aware_ap.item() == pytest.approx((1 / 2 + 2 / 3 + 3 / 5) / 4)
    assert (found.phc.item(), found.recall.item()) == (False, 0.75)
    np.testing.assert_allclose(found.mean_curve(), [2 / 3] * 6 + [3 / 5] * 5)
    plain = score_plainly([False, True, True, False, True], 4)
    assert plain["average_precision"] == pytest.approx(found.average_precision.item())


def test_missed_planes_and_trailing_guesses_cost_nothing_in_map_but_show_in_ours():
    one_of_many = evaluate(*ranked_hits([1], true_count=10), [1.0], count_threshold=0.5).mean()
    assert one_of_many == {"mAP": 1, "PHC": 1, "recall_aware_mAP": 0.1, "recall": 0.1, "count_accuracy": 0}
    flood = evaluate(*ranked_hits([1, 1] + [0] * 50, true_count=2), [1.0]).mean()
    assert flood == {"mAP": 1, "PHC": 1, "recall_aware_mAP": 1, "recall": 1, "count_accuracy": 0}


def test_recall_bins_are_met_exactly():
    for true_count in (3, 7, 10, 13):
        for matched in range(1, true_count + 1):
            hits = [1] * (matched - 1) + [0, 1]
            curve = evaluate(*ranked_hits(hits, true_count), [1.0]).mean_curve()
            np.testing.assert_array_equal(curve, score_plainly(hits, true_count)["curve"])


def test_recall_aware_ap_is_ap_times_recall():
    predicted, truth, diagonals = random_clouds(6)
    found = evaluate(PackedPlanes.pack(predicted), PackedPlanes.pack(truth), diagonals, [1, 5], [0.01, 0.1])
    np.testing.assert_allclose(found.recall_aware_ap, found.average_precision * found.recall, atol=1e-15)
    assert 0 < found.recall.mean() < 1
    assert (np.diff(found.recall.mean(-1), axis=0) >= 0).all()


def test_clouds_without_planes_on_either_side():
    one, none = Planes([[1, 0, 0]], [[0, 0, 0]], [0.4]), Planes.empty()
    predicted, truth = PackedPlanes.pack([none, one, none, one]), PackedPlanes.pack([none, none, one, one])
    found = evaluate(predicted, truth, np.ones(4), count_threshold=0.5)
    assert found.average_precision.ravel().tolist() == [0, 0, 0, 1]
    assert found.phc.ravel().tolist() == [0, 0, 0, 1]
    assert found.recall_aware_ap.ravel().tolist() == [1, 1, 0, 1]
    assert found.count_correct.tolist() == [True, True, False, False]
    certain = evaluate(predicted, truth, np.ones(4), count_threshold=0.4)
    assert certain.recall.ravel().tolist() == [1, 0, 0, 1]
    assert certain.count_correct.tolist() == [True, False, False, True]


def test_no_clouds_score_but_have_no_mean():
    nothing = PackedPlanes.pack([])
    found = evaluate(nothing, nothing, [])
    assert found.average_precision.shape == (1, 1, 0)
    assert grouped(found, []) == []
    for mean in (found.mean, found.mean_curve):
        with pytest.raises(ValueError, match="no cloud to average"):
            mean()


def test_groups_average_their_clouds_alone():
    predicted, truth, diagonals = random_clouds(7, clouds=24)
    labels = [Labels(("egg_keplero", "astroid", "star")[k % 3], "cone", ("P1", UNKNOWN)[k % 2]) for k in range(24)]
    assert list(group_masks(labels)) == ["all", "P1", "astroid", "egg_keplero", "star", "cone"]
    found = evaluate(PackedPlanes.pack(predicted), PackedPlanes.pack(truth), diagonals, [1, 5], [0.01, 0.02, 0.05], 0.5)
    rows = {(row.metric, row.group, row.theta_deg, row.epsilon): row for row in grouped(found, labels)}
    assert len(rows) == len(METRICS) * 6 * 6
    astroids = evaluate(
        PackedPlanes.pack(predicted[1::3]), PackedPlanes.pack(truth[1::3]), diagonals[1::3], 5, 0.02, 0.5
    )
    for metric, value in astroids.mean().items():
        assert rows[metric, "astroid", 5, 0.02].value == pytest.approx(value)
    assert rows["mAP", "astroid", 5, 0.02].clouds == 8
    assert rows["PHC", "cone", 1, 0.01].value == rows["PHC", "all", 1, 0.01].value
    with pytest.raises(ValueError, match="24 clouds and labels of 23"):
        grouped(found, labels[1:])


def test_curves_not_kept_are_not_shown():
    found = evaluate(*ranked_hits([1], 1), [1.0], curves=False)
    with pytest.raises(ValueError, match="curves=True"):
        found.mean_curve()
