"""The sampling error of mAP below the tables."""

import numpy as np
import pytest

from symshrec.benchmark.cloud import Labels
from symshrec.metrics import evaluate, grouped
from symshrec.planes import PackedPlanes, Planes
from symshrec.reporting.tables.layouts import Layout
from symshrec.reporting.tables.sampling import sampling_error, sampling_note

WHOLE = Layout(2, "", {"all": "all"}, 4)
COLUMNS = Layout(3, "", {"P0": "P0", "P1": "P1"}, 3)


def a_result(right: int, wrong: int, name: str = "one", oracle: bool = False) -> dict:
    """Scores of clouds with one true plane, so often found and so often not; P0 and P1 in turn."""
    truth = [Planes([[1, 0, 0]], [[0, 0, 0]])] * (right + wrong)
    found = truth[:right] + [Planes([[0, 1, 0]], [[0, 0, 0]])] * wrong
    scores = evaluate(PackedPlanes.pack(found), PackedPlanes.pack(truth), np.ones(len(truth)))
    labels = [Labels("citrus", "cone", f"P{place % 2}") for place in range(len(truth))]
    return {"name": name, "oracle": oracle, "scores": [row._asdict() for row in grouped(scores, labels)]}


def test_it_is_the_spread_of_means_over_clouds_drawn_anew():
    error, clouds = sampling_error(a_result(30, 10), "all", 1.0, 0.01)
    drawn = np.random.default_rng(0).random((20_000, 40)) < 0.75
    assert clouds == 40
    assert error == pytest.approx(drawn.mean(axis=1).std(), rel=0.03)


def test_rows_that_stored_none_have_an_upper_bound_of_it():
    stored = a_result(30, 10)
    older = {**stored, "scores": [{k: v for k, v in row.items() if k != "standard_error"} for row in stored["scores"]]}
    exact, bound = (sampling_error(each, "all", 1.0, 0.01)[0] for each in (stored, older))
    assert bound == pytest.approx(np.sqrt(0.75 * 0.25 / 40))
    assert 0.95 * exact < bound < exact * 1.05


def test_the_note_names_the_largest_of_the_rows_but_not_the_oracles():
    rows = [a_result(30, 10), a_result(39, 1, "two"), a_result(20, 20, "told", oracle=True)]
    note = sampling_note(rows, [WHOLE, COLUMNS])
    whole, column = (sampling_error(rows[0], group, 1.0, 0.01)[0] for group in ("all", "P0"))
    assert f"at most {whole:.3f} over all 40 clouds and {column:.3f} in a column (20 clouds)." in note
    assert sampling_note(rows[2:], [WHOLE]) == ""
