"""Everything behind the tables in one process: only what is missing is made, and the whole is what is shown."""

from pathlib import Path

import pytest

from symshrec.runs.config import load
from symshrec.runs.progress import duration, measured_before
from symshrec.runs.reproduce import reproduce


@pytest.fixture(scope="module")
def words(tmp_path_factory):
    """Of a command whose rows take no time: the true planes, on small clouds of all three kinds."""
    home = tmp_path_factory.mktemp("home")
    small = ["surface.points=200", "surface.citrus_points=200", "clouds_per_shard=42"]
    return [
        *("data=smoke", *(f"data.benchmark.{each}" for each in small)),
        *(f"paths.{name}={home / name}" for name in ("data", "runs", "results")),
        *("rows.published=[oracle]", "rows.ours=[]", "rows.refined=[]", "method.refine=false"),
        "folder=${paths.runs}/${data.name}/${name}",
        *("logger=none", "callbacks=none", "workers=1"),
    ]


def test_all_is_made_once_and_then_only_what_is_missing(words, capsys, monkeypatch):
    config = load(words)
    text = reproduce(config, words)
    said = capsys.readouterr().out
    assert "3 rows: 0 up to date, 3 to run\n" in said  # nothing is known of how long they take
    assert [line[:6] for line in said.splitlines()[1:]] == ["1 of 3", "2 of 3", "3 of 3"]
    assert "left" not in said.splitlines()[-1]
    assert "Table 2" in text
    runs = Path(config.paths.runs)
    assert {path.parent.parent.name for path in runs.glob("*/oracle/metrics.json")} == {
        "smoke",
        "hard_quick",
        "scan_quick",
    }
    with monkeypatch.context() as patched:
        patched.setattr("symshrec.runs.progress.jobs_of", lambda *_: pytest.fail("looked at the rows"))
        assert reproduce(config, words).startswith(text)
    (runs / "scan_quick" / "oracle" / "predictions" / "predictions.safetensors").unlink()
    assert reproduce(config, words) == text
    said = capsys.readouterr().out.splitlines()
    assert said[0] == "3 rows: 2 up to date, 1 to run, about 1 s by the seconds that a cloud took on this machine"
    assert [line[:6] for line in said[1:]] == ["3 of 3"]
    table = Path(config.paths.tables) / "table2.md"
    table.write_text("changed by hand")
    assert reproduce(config, words) == text
    assert "Table 2" in table.read_text()


def test_another_command_is_not_taken_for_the_one_before(words, capsys):
    more = [*words, "rows.all=true"]
    reproduce(load(words), words)
    capsys.readouterr()
    reproduce(load(more), more)
    assert "4 rows: 3 up to date, 1 to run" in capsys.readouterr().out  # the oracle's refined row


@pytest.mark.parametrize("word", ["data.root=elsewhere", "name=mine", "pose=so3"])
def test_what_would_be_the_same_for_all_rows_is_refused_before_anything_is_made(words, word):
    with pytest.raises(ValueError, match=r"would be the same for all data and rows|is something else"):
        reproduce(load([*words, word]), [*words, word])


def test_the_time_of_a_row_is_expected_from_what_was_published(tmp_path):
    words = ["data=quick", "experiment=ransac", f"paths.runs={tmp_path}", "paths.results=results"]
    seconds, machine = measured_before(load(words))
    assert 0.01 < seconds < 10
    assert machine
    assert measured_before(load([*words, f"paths.results={tmp_path}"])) == (None, "")


def test_times_are_readable():
    assert [duration(each) for each in (0.2, 59.6, 200, 12_240)] == ["1 s", "60 s", "3 min", "3.4 h"]
