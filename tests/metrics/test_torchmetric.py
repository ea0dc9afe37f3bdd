import multiprocessing

import numpy as np
import pytest
import torch
from torch import distributed

from symshrec.benchmark.cloud import UNKNOWN, Labels
from symshrec.metrics import METRICS, evaluate
from symshrec.metrics.torchmetric import SymmetryMetric
from symshrec.planes import PackedPlanes, Planes

THETAS, EPSILONS = [1.0, 20.0], [0.01, 0.1, 0.3]


def clouds(count=23, seed=0):
    """Arguments of update() for `count` clouds, some without predictions, some without true planes."""
    rng = np.random.default_rng(seed)
    truth = [Planes(rng.normal(size=(k, 3)), rng.normal(size=(k, 3))) for k in rng.integers(0, 5, count)]
    predicted = []
    for true in truth:
        scale = 10 ** rng.uniform(-3, 0)
        noisy = (
            true.normals + scale * rng.normal(size=(len(true), 3)),
            true.points + scale * rng.normal(size=(len(true), 3)),
        )
        predicted.append(Planes(*noisy, rng.random(len(true)))[rng.random(len(true)) < 0.8])
    labels = [Labels(("astroid", "mouth_curve", UNKNOWN)[k % 3], "cone", f"P{k % 6}") for k in range(count)]
    return predicted, truth, rng.uniform(1, 3, count), labels, list(range(100, 100 + count))


def batch(columns, rows):
    return [[column[row] for row in rows] for column in columns]


def metric_of(columns, *batches, **settings):
    metric = SymmetryMetric(THETAS, EPSILONS, count_threshold=0.5, **settings)
    for rows in batches:
        metric.update(*batch(columns, rows))
    return metric


def assert_same(evaluation, other):
    scores, labels, positions = evaluation
    for name in ("average_precision", "recall_aware_ap", "phc", "recall", "count_correct", "curve"):
        np.testing.assert_array_equal(getattr(scores, name), getattr(other[0], name))
    assert labels == other[1]
    np.testing.assert_array_equal(positions, other[2])


def test_equals_the_pure_function_and_keeps_labels_and_positions():
    columns = predicted, truth, diagonals, labels, positions = clouds()
    metric = metric_of(columns, range(23))
    expected = evaluate(PackedPlanes.pack(predicted), PackedPlanes.pack(truth), diagonals, THETAS, EPSILONS, 0.5)
    assert_same(metric.evaluation(), (expected, labels, positions))
    means = metric.compute()
    assert tuple(means) == METRICS
    assert 0 < means["mAP"][1, 2] < 1
    np.testing.assert_array_equal(means["recall"].numpy(), expected.means()["recall"])


def test_one_tolerance_pair_gives_scalars_to_log():
    metric = SymmetryMetric()
    metric.update(*clouds())
    assert all(value.shape == () and value.dtype == torch.float64 for value in metric.compute().values())


def test_batches_order_and_duplicates_change_nothing():
    columns = clouds()
    whole = metric_of(columns, range(23)).evaluation()
    assert_same(metric_of(columns, [22, 3], [], range(4, 22), [0, 3], [2], [1, 0]).evaluation(), whole)


def test_half_precision_modules_keep_planes_exact():
    columns = clouds()
    holder = torch.nn.ModuleList([metric_of(columns, range(23))])
    assert_same(holder.half()[0].evaluation(), metric_of(columns, range(23)).evaluation())


def test_reset_forgets():
    columns = clouds()
    metric = metric_of(columns, range(23))
    metric.reset()
    metric.update(*batch(columns, range(5)))
    assert_same(metric.evaluation(), metric_of(columns, range(5)).evaluation())


def _one_process(rank, folder, shares):
    torch.set_num_threads(1)
    store = f"file://{folder}/rendezvous"
    distributed.init_process_group("gloo", init_method=store, rank=rank, world_size=len(shares))
    columns = clouds()
    metric = metric_of(columns, *shares[rank])
    for _ in range(2):  # a second time: gathering must leave each process its own share
        assert_same(metric.evaluation(), metric_of(columns, range(23), sync_on_compute=False).evaluation())
    gathered = metric.compute()["mAP"]
    assert torch.equal(gathered, metric_of(columns, range(23), sync_on_compute=False).compute()["mAP"])
    assert sum(len(rows) for rows in metric.clouds) == sum(map(len, shares[rank]))
    distributed.destroy_process_group()


@pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="forks to be quick")
@pytest.mark.parametrize(
    "shares",
    [([range(0, 23, 2)], [range(1, 23, 2), [0]]), ([range(23)], [])],
    ids=["uneven with a duplicate", "one idle"],
)
def test_processes_agree_with_one(tmp_path, shares):
    context = multiprocessing.get_context("fork")
    processes = [context.Process(target=_one_process, args=(rank, tmp_path, shares)) for rank in range(2)]
    for process in processes:
        process.start()
    for process in processes:
        process.join(30)
    codes = [process.exitcode for process in processes]
    for process in processes:
        process.kill()
    assert codes == [0, 0]


def test_what_cannot_be_scored_is_refused():
    columns = clouds(2)
    metric = SymmetryMetric()
    with pytest.raises(ValueError, match=r"lengths \[2, 2, 2, 2, 1\]"):
        metric.update(*columns[:4], [0])
    with pytest.raises(ValueError, match="truth of cloud 101 is withheld"):
        metric.update(columns[0], [columns[1][0], None], *columns[2:])
    with pytest.raises(ValueError, match=r"'xxx.* longer than 32 bytes"):
        metric.update(*columns[:3], [Labels("x" * 33)] * 2, columns[4])
    with pytest.raises(ValueError, match="no cloud"), pytest.warns(UserWarning, match="before the ``update``"):
        SymmetryMetric().compute()
