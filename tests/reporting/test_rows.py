"""Which runs stand in a table: every finished one, and none that does not belong."""

import json
import re

import pytest

from symshrec.benchmark.cloud import FAMILIES, PUBLISHED_PERTURBATIONS, SOLIDS
from symshrec.metrics import METRICS
from symshrec.reporting.tables.rows import find_rows

GROUPS = ("all", *PUBLISHED_PERTURBATIONS, *FAMILIES, *SOLIDS)


@pytest.fixture
def leave(tmp_path):
    """Leave the metrics.json of a run in a folder of runs."""

    def left(run, name, clouds=630, manifest="ab" * 32, theta_deg=1.0, **more):
        scores = [
            {"metric": metric, "group": group, "theta_deg": theta_deg, "epsilon": 0.01, "value": 0.5}
            for metric in METRICS
            for group in GROUPS
        ]
        data = {"name": "quick", "split": "test", "clouds": clouds, "manifest_sha256": manifest}
        result = {"name": name, "scores": scores, "data": data, "code": {"version": "0.2.0"}, **more}
        (tmp_path / run).mkdir(parents=True)
        (tmp_path / run / "metrics.json").write_text(json.dumps(result))

    return left


def test_listed_rows_come_first_and_every_other_finished_run_after_them_by_name(leave, tmp_path):
    leave("m4_sharp", "M4")
    leave("m3_k200", "M3 (R1)")
    leave("zebra", "Zebra")
    leave("m3_k200/method.neighbours=100", "M3 (R1)")
    leave("mine_own", "M1 (R4)")
    for no_run in ("m2_scratch", "m4_sharp/predictions.abc", "tables", "training/m1"):
        leave(no_run, no_run)
    rows = find_rows(tmp_path, ["m3_k200", "m1_r1", "m4_sharp"], apart=["m2_scratch"])
    assert {run: result["name"] for run, result in rows.results.items()} == {
        "m3_k200": "M3 (R1)",
        "m4_sharp": "M4",
        "m3_k200/method.neighbours=100": "M3 (R1) (m3_k200/method.neighbours=100)",
        "mine_own": "M1 (R4) (mine_own)",  # published by others
        "zebra": "Zebra",
    }
    assert list(rows.results) == ["m3_k200", "m4_sharp", "m3_k200/method.neighbours=100", "mine_own", "zebra"]
    assert (rows.missing, rows.left_out) == (["m1_r1"], [])


def test_runs_that_do_not_belong_are_left_out_with_the_reason(leave, tmp_path):
    leave("m4_sharp", "M4")
    leave("m3_k200", "M3 (R1)", partial=True, clouds=32)
    leave("few", "Few", clouds=12)
    leave("old", "Old", manifest="cd" * 32)
    leave("part", "Part", partial=True)
    leave("tight", "Tight", theta_deg=0.1)
    leave("broken", None)
    rows = find_rows(tmp_path, ["m3_k200", "m4_sharp"])
    assert list(rows.results) == ["m4_sharp"]
    reasons = {
        "m3_k200": "ended after 32 clouds, before the last; evaluate that run again",
        "few": "measured on other clouds .*12 clouds.* than the other rows .*630 clouds",
        "old": "measured on other clouds .*manifest cdcd.*abab",
        "part": "before the last",
        "tight": "no score for metric mAP, group all",
        "broken": "name is null, expected text",
    }
    for run, reason in reasons.items():
        (line,) = [line for line in rows.left_out if f"/{run}" in line]
        assert re.search(reason, line)
    assert len(rows.left_out) == len(reasons)


def test_listed_runs_on_another_version_of_the_data_are_all_named(leave, tmp_path):
    leave("m4_sharp", "M4")
    leave("m4_fast", "M4, fast", manifest="cd" * 32)
    leave("m3_k200", "M3 (R1)", manifest="ef" * 32)
    listed = ["m3_k200", "m4_fast", "m4_sharp"]
    with pytest.raises(ValueError, match=r"manifest abab.*: m3_k200 \(.*efef.*, m4_fast \(.*evaluate them again"):
        find_rows(tmp_path, listed, manifest="ab" * 32)
    assert list(find_rows(tmp_path, ["m4_sharp"], manifest="ab" * 32).results) == ["m4_sharp"]
    assert len(find_rows(tmp_path, [], manifest="cd" * 32).results) == 1


def test_optional_runs_are_neither_missed_nor_refused_where_they_are_of_older_data(leave, tmp_path):
    leave("m4", "M4")
    leave("m3_refine", "M3 + refine", manifest="cd" * 32)
    optional = ["m3_refine", "oracle_refine"]
    rows = find_rows(tmp_path, ["m4", *optional], manifest="ab" * 32, optional=optional)
    assert (list(rows.results), rows.missing) == (["m4"], [])
    (line,) = rows.left_out
    assert re.search(r"m3_refine was measured on another version of the data \(.*cdcd", line)
