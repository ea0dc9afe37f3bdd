"""Tables of what has run lie under runs/; results/ holds what was published."""

import json
from pathlib import Path

import pytest

from symshrec.runs.evaluate import evaluate
from symshrec.runs.tabulate import publish, tabulate


@pytest.fixture
def runs(smoke_config, tmp_path):
    """overrides → configuration of a run of the oracle, which takes no time, in folders of this test."""

    def compose(*overrides: str):
        places = [f"paths.{name}={tmp_path / name}" for name in ("runs", "results")]
        folder = "folder=${paths.runs}/${data.name}${data.variant}/${name}"
        oracle = [
            "method=oracle",
            "method.refine=false",
            "data.hard=none",
            "name=oracle",
            "rows={published:[oracle],ours:[m4],refined:[],so3:[],so3_refined:[],cards:[card]}",
        ]
        return smoke_config(*oracle, *places, folder, "logger=none", *overrides)

    return compose


def test_tables_lie_under_runs_until_they_are_published(runs, tmp_path):
    for overrides in ([], ["name=other", "title=Another", "method.angle_deg=5"], ["name=card", "title=Card"]):
        evaluate(runs(*overrides))
    done = tabulate(runs())
    folder, kept = tmp_path / "runs" / "smoke" / "tables", tmp_path / "results"
    assert {path.parent for path in done.files} == {folder}
    assert not kept.exists()
    table = (folder / "table2.md").read_text()
    assert table.index("| Truth") < table.index("| Another") < table.index("Not run: m4.")
    assert "| Card" not in table
    assert done.remarks[0] == "not run, so left out: m4"
    assert "rows.all=true" in done.remarks[1]
    written = publish(runs())
    assert set(written) == {path for path in kept.rglob("*") if path.is_file()}
    names = {path.relative_to(kept / "smoke").as_posix() for path in written}
    assert {
        "table2.csv",
        "precision_recall.png",
        "oracle/config.yaml",
        "other/metrics.json",
        "card/metrics.json",
    } <= names
    assert (kept / "smoke" / "table2.md").read_text() == table
    assert not any("predictions" in name or name == "rows.json" for name in names)
    assert tabulate(runs("rows.all=true")).remarks == ["not run, so left out: m4, oracle_refine"]


def test_publishing_refuses_tables_that_are_missing_or_older_than_the_runs(runs, tmp_path):
    with pytest.raises(ValueError, match=r"no tables to publish in .*smoke/tables; make them with"):
        publish(runs())
    evaluate(runs())
    tabulate(runs())
    evaluate(runs("method.angle_deg=1"))
    with pytest.raises(ValueError, match=r"changed since the tables .* were made: smoke/oracle; make them with"):
        publish(runs())
    assert not (tmp_path / "results").exists()


@pytest.mark.parametrize("harm", [Path.unlink, lambda path: path.write_bytes(b"cut")])
def test_tables_name_the_run_whose_predictions_are_gone_or_damaged(runs, harm):
    evaluate(runs())
    evaluate(runs("name=other", "title=Another"))
    folder = Path(runs().folder)
    for name in ("other", "oracle"):
        harm(folder.with_name(name) / "predictions" / "predictions.safetensors")
    with pytest.raises(ValueError, match=r"oracle/predictions.* evaluate oracle again, which predicts") as error:
        tabulate(runs())
    assert "\n" not in str(error.value)
    evaluate(runs())
    (line,) = [line for line in tabulate(runs()).remarks if "other" in line]
    assert line.startswith("left out: ")
    assert line.endswith("evaluate other again")


def test_a_run_without_predictions_is_in_the_tables_where_metrics_are_enough(runs, tmp_path):
    evaluate(runs())
    evaluate(runs("name=other", "title=Another", "method.angle_deg=5"))
    table, folder = tabulate(runs()).text, Path(runs().folder)
    (folder / "predictions" / "predictions.safetensors").unlink()
    done = tabulate(runs("rows.by_metrics=true"))
    assert done.text == table
    assert "without predictions, so neither in reliability.png nor refinement.*: oracle" in done.remarks
    publish(runs("rows.by_metrics=true"))
    assert (tmp_path / "results" / "smoke" / "oracle" / "metrics.json").exists()


def test_tables_say_how_to_begin(runs):
    with pytest.raises(ValueError, match=r"no finished run in .*smoke; symshrec reproduce data=smoke makes them all"):
        tabulate(runs())


def test_data_without_the_papers_perturbations_are_refused_with_where_their_table_is(runs):
    without = runs("data.perturbations=[P0]", "data.variant=-clean")
    evaluate(without)
    with pytest.raises(ValueError, match=r"data=smoke has no P1, P2, P3, P4, P5\. .* P10–P15 stand in .* data=quick"):
        tabulate(without)


def test_a_partial_run_enters_no_table(runs):
    evaluate(runs())
    evaluate(runs("name=part", "title=Part", "data.batch_size=8", "+trainer.limit_test_batches=1"))
    assert "| Part" not in tabulate(runs()).text
    path = Path(runs().folder) / "metrics.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"partial": True}))
    with pytest.raises(ValueError, match="no finished run"):
        tabulate(runs())
