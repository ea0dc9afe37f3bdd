import csv
import json
import random
from importlib.resources import files

import pytest

from symshrec.benchmark.cloud import FAMILIES, HARD_PERTURBATIONS, PUBLISHED_PERTURBATIONS, SCAN_PERTURBATIONS, SOLIDS
from symshrec.reporting.tables.published import published_cells, published_methods
from symshrec.reporting.tables.published_tables import write_tables
from symshrec.reporting.tables.results import HIDDEN_METRICS, PUBLISHED_METRICS, find_score, read_result
from symshrec.reporting.tables.sweep import sweep_curves
from symshrec.reporting.tables.typeset import Grid, Text, latex, markdown

GROUPS = ("all", *PUBLISHED_PERTURBATIONS, *FAMILIES, *SOLIDS)
HARD_GROUPS = ("all", *HARD_PERTURBATIONS, *FAMILIES, *SOLIDS)
SCAN_GROUPS = ("all", *SCAN_PERTURBATIONS, *FAMILIES, *SOLIDS)
TABLED = [(theta, epsilon) for theta in (1.0, 0.1) for epsilon in (0.01, 0.001)]


def a_result(name, tolerances=((1.0, 0.01),), value=None, commit="c0ffee" * 6, manifest="ab" * 32, groups=GROUPS):
    """A metrics.json with random scores, or value(metric, group) where given."""
    rng = random.Random(name)
    scores = [
        {
            "metric": metric,
            "group": group,
            "theta_deg": theta,
            "epsilon": epsilon,
            "value": value(metric, group) if value else rng.random(),
            "clouds": 10,
        }
        for metric in PUBLISHED_METRICS + HIDDEN_METRICS
        for group in groups
        for theta, epsilon in tolerances
    ]
    data = {"name": "quick", "split": "test", "clouds": 1630, "manifest_sha256": manifest}
    return {"name": name, "scores": scores, "data": data, "code": {"version": "0.1.0", "commit": commit}}


def read_csv(path):
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def published_score(name, metric, group):
    """What the paper prints for this method in whichever table has the group; 0.5 where it prints nothing."""
    values = [v for (_, m, k, g), v in published_cells().items() if (m, k, g) == (name, metric, group)]
    return values[0] if values else 0.5


def test_published_cells_round_trip(tmp_path):
    results = [a_result(n, value=lambda m, g, n=n: published_score(n, m, g)) for n in published_methods()]
    write_tables(results, tmp_path)
    source = csv.DictReader(files("symshrec.reporting.tables").joinpath("published.csv").read_text().splitlines())
    expected = {tuple(row[k] for k in ("table", "method", "metric", "group")): row["value"] for row in source}
    found = {}
    for number in (2, 3, 4):
        for row in read_csv(tmp_path / f"table{number}.csv"):
            assert list(row) == ["table", "method", "metric", "group", "ours", "published", "difference"]
            if row["published"]:
                found[row["table"], row["method"], row["metric"], row["group"]] = row["published"]
                assert float(row["ours"]) == float(row["published"])
                assert float(row["difference"]) == 0
    assert found == expected
    assert len(found) == 14 + 84 + 98


def test_differences_blanks_and_hidden_metrics(tmp_path):
    ours = {"M3 (R1)": a_result("M3 (R1)"), "M4": a_result("M4")}
    paths, text = write_tables(list(ours.values()), tmp_path)
    assert {path.name for path in paths} == {f"table{n}.{s}" for n in (2, 3, 4) for s in ("md", "csv", "tex")}
    assert {path.name for path in tmp_path.iterdir()} == {path.name for path in paths}
    for row in (row for number in (2, 3, 4) for row in read_csv(tmp_path / f"table{number}.csv")):
        if row["method"] in ours:
            value = find_score(ours[row["method"]], row["metric"], row["group"])
            assert float(row["ours"]) == pytest.approx(value, abs=1e-6)
        else:
            assert row["ours"] == row["difference"] == ""
            assert row["metric"] in PUBLISHED_METRICS
        if row["method"] == "M3 (R1)" and row["metric"] in PUBLISHED_METRICS:
            assert float(row["difference"]) == pytest.approx(float(row["ours"]) - float(row["published"]), abs=2e-6)
        else:
            assert row["difference"] == ""
    for metric in ("recall-aware mAP", "recall", "count accuracy"):
        assert text.count(metric) >= 3
    for part in ("M1 (R4)", "0.9707", "1,630 clouds", "manifest abababababab", "symshrec 0.1.0 at c0ffeec0ffee"):
        assert part in text


def test_best_of_ours_is_bold_and_a_lone_row_is_not(tmp_path):
    high, low = a_result("M4", value=lambda *_: 0.75), a_result("M3 (R1)", value=lambda *_: 0.25)
    _, both = write_tables([low, high], tmp_path)
    assert "**0.7500**" in both
    assert "**0.25" not in both
    assert r"\textbf{0.7500}" in (tmp_path / "table2.tex").read_text()
    assert "**" not in write_tables([low], tmp_path)[1]


def test_an_oracle_is_no_best_of_ours_and_is_explained(tmp_path):
    low, high = a_result("M3 (R1)", TABLED, value=lambda *_: 0.25), a_result("M4", TABLED, value=lambda *_: 0.75)
    for score in (0.75, 0.875):
        oracle = a_result("Truth + refine", TABLED, value=lambda *_, score=score: score) | {"oracle": True}
        _, text = write_tables([low, high, oracle], tmp_path)
        rows = [line for line in text.splitlines() if line.startswith("| Truth + refine")]
        assert rows
        assert not any("**" in row for row in rows)
        assert "**0.750**" in (tmp_path / "table_tight.md").read_text()
        assert "Truth + refine is no method" in (tmp_path / "table_tight.md").read_text()
        assert "**" not in write_tables([low, oracle], tmp_path)[1]
    assert "is no method" not in write_tables([low, high], tmp_path)[1]


@pytest.mark.parametrize(("metric", "group"), [("mAP", "P3"), ("PHC", "all"), ("recall", "egg_keplero")])
def test_missing_score_is_named_and_nothing_is_written(tmp_path, metric, group):
    result = a_result("M4") | {"file": "runs/quick/m4/metrics.json"}
    result["scores"] = [s for s in result["scores"] if (s["metric"], s["group"]) != (metric, group)]
    with pytest.raises(ValueError, match=rf"runs/quick/m4/metrics.json.*{metric}.*{group} "):
        write_tables([result], tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_group_without_clouds_is_blank(tmp_path):
    result = a_result("M4", value=lambda m, g: None if g == "P5" else 0.5)
    write_tables([result], tmp_path)
    rows = [r for r in read_csv(tmp_path / "table3.csv") if r["method"] == "M4"]
    assert {r["group"] for r in rows} == set(PUBLISHED_PERTURBATIONS) - {"P5"}


def test_the_tight_table_has_the_rows_that_were_scored_there(tmp_path):
    tight, plain = a_result("M3 (R1) + refine", TABLED), a_result("M3 (R1)")
    paths, _ = write_tables([plain, tight], tmp_path)
    assert {path.stem for path in paths} == {"table2", "table3", "table4", "table_tight"}
    rows = read_csv(tmp_path / "table_tight.csv")
    assert list(rows[0]) == ["table", "method", "metric", "group", "ours", "published", "difference"]
    assert {(row["table"], row["method"], row["published"]) for row in rows} == {("tight", "M3 (R1) + refine", "")}
    assert len(rows) == 5 * (1 + 6 + 7)
    for row in rows:
        value = find_score(tight, row["metric"], row["group"], 0.1, 0.001)
        assert float(row["ours"]) == pytest.approx(value, abs=1e-6)
    printed = (tmp_path / "table_tight.md").read_text()
    assert "θ = 0.1°, ε = 0.1%" in printed
    assert "M1 (R4)" not in printed
    assert "M3 (R1) + refine" in (tmp_path / "table2.md").read_text()


def test_runs_on_other_data_have_tables_of_their_own(tmp_path):
    main = [a_result("M3 (R1)"), a_result("M4")]
    hard = [a_result("M4", manifest="ef" * 32, groups=HARD_GROUPS)]
    so3 = [a_result("M4", TABLED, manifest="cd" * 32)]
    scan = [a_result("RANSAC + ICP", manifest="0f" * 32, groups=SCAN_GROUPS)]
    paths, _ = write_tables(main, tmp_path, hard=hard, so3=so3, scan=scan)
    assert {path.stem for path in paths} == {"table2", "table3", "table4", "table_hard", "table_scan", "table_so3"}
    rows = read_csv(tmp_path / "table_scan.csv")
    assert [row["group"] for row in rows[:7]] == ["all", "P10", "P11", "P12", "P13", "P14", "P15"]
    assert float(rows[6]["ours"]) == pytest.approx(find_score(scan[0], "mAP", "P15"), abs=1e-6)
    rows = read_csv(tmp_path / "table_hard.csv")
    assert [row["group"] for row in rows[:5]] == ["all", "P6", "P7", "P8", "P9"]
    assert {(row["table"], row["method"]) for row in rows} == {("hard", "M4")}
    assert {row["metric"] for row in rows} == set(PUBLISHED_METRICS + HIDDEN_METRICS)
    assert float(rows[1]["ours"]) == pytest.approx(find_score(hard[0], "mAP", "P6"), abs=1e-6)
    assert "manifest efefefefefef" in (tmp_path / "table_hard.md").read_text()
    assert float(read_csv(tmp_path / "table_so3.csv")[0]["ours"]) == pytest.approx(
        find_score(so3[0], "mAP", "all"), abs=1e-6
    )
    with pytest.raises(ValueError, match="both named 'M4'"):
        write_tables(main, tmp_path, hard=[*hard, a_result("M4", groups=HARD_GROUPS)])


def test_results_that_do_not_belong_together_are_refused(tmp_path):
    with pytest.raises(ValueError, match="no results"):
        write_tables([], tmp_path)
    with pytest.raises(ValueError, match="both named 'M4'"):
        write_tables([a_result("M4"), a_result("M4")], tmp_path)
    runs = [("M4", "cd"), ("M3 (R1)", "ab"), ("M3 (R2)", "ab")]
    results = [a_result(name, manifest=manifest * 32) | {"file": name} for name, manifest in runs]
    message = r"different data.* M3 \(R1\), M3 \(R2\) on .*abab.*; M4 on .*cdcd.*evaluate M4 again"
    with pytest.raises(ValueError, match=message):
        write_tables(results, tmp_path)
    with pytest.raises(ValueError, match=r"mAP, group all is 1\.5, outside"):
        write_tables([a_result("M4", value=lambda *_: 1.5)], tmp_path)


def test_read_result_names_file_and_field(tmp_path):
    path = tmp_path / "metrics.json"
    path.write_text(json.dumps(a_result("M4")))
    assert read_result(path)["file"] == str(path)
    path.write_text('{"name": "M4"')
    with pytest.raises(ValueError, match=r"metrics\.json is not a metrics\.json: .*line 1"):
        read_result(path)
    path.write_text('{"name": "M4", "scores": []}')
    with pytest.raises(ValueError, match=r"metrics\.json lacks data, code"):
        read_result(path)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"scores": None}, "scores is null, expected a list"),
        ({"scores": [1]}, r"scores\[0\] is 1, expected an object"),
        ({"scores": [{"metric": "mAP", "group": "all", "epsilon": 1, "value": 1}]}, r"scores\[0\] lacks theta_deg"),
        ({"name": 3}, "name is 3, expected text"),
        ({"data": {"name": "quick", "split": "test"}}, "data lacks clouds"),
        ({"data": {"name": "quick", "split": "test", "clouds": True}}, "data.clouds is true, expected a number"),
        ({"code": {"version": None}}, "code.version is null, expected text"),
        ({"weights": [{"name": "m1"}]}, r"weights\[0\] lacks sha256, about"),
        ({"precision_recall": {}}, "precision_recall is {}, expected a list"),
    ],
)
def test_a_field_of_the_wrong_type_is_one_line_that_names_it(tmp_path, change, message):
    path = tmp_path / "metrics.json"
    path.write_text(json.dumps(a_result("M4") | change))
    with pytest.raises(ValueError, match=rf"metrics\.json: {message}.*evaluate that run again") as error:
        read_result(path)
    assert "\n" not in str(error.value)


def test_runs_that_have_not_run_are_named_below_their_tables(tmp_path):
    hard = [a_result("M4", groups=HARD_GROUPS)]
    write_tables([a_result("M4")], tmp_path, hard=hard, missing={"main": ["m1_r5"], "hard": ["m4_fast", "m3_k200"]})
    for name, line in (("table2", "Not run: m1_r5."), ("table_hard", "Not run: m4_fast, m3_k200.")):
        text = (tmp_path / f"{name}.md").read_text()
        assert text.index("| M4") < text.index(line)
    write_tables([a_result("M4")], tmp_path)
    assert "Not run" not in (tmp_path / "table2.md").read_text()


def test_sweep_is_tabulated_along_the_papers_tolerances(tmp_path):
    pairs = [(t, e) for t in (0.1, 1.0, 10.0) for e in (0.001, 0.01)]
    result = a_result("M4", tolerances=pairs)
    paths, text = write_tables([result, a_result("M3 (R1)")], tmp_path)
    assert tmp_path / "sweep.csv" in paths
    assert "sweep" not in {path.stem for path in write_tables([a_result("M4", TABLED)], tmp_path)[0]}
    assert len(read_csv(tmp_path / "sweep.csv")) == 2 * len(pairs)
    assert "θ 10°" in text
    assert "ε 0.1%" in text
    curves = sweep_curves(result, "mAP")
    assert curves["theta"][0] == [0.1, 1.0, 10.0]
    assert curves["theta"][2] == 0.01
    assert curves["epsilon"][1] == [find_score(result, "mAP", "all", 1.0, e) for e in (0.001, 0.01)]


def test_typesetting_lines_up_and_escapes():
    grid = Grid("A & B", ["method", "θ 1%"], [[Text("M3_x"), Text("−0.1", strong=True)], [Text("M"), Text("10")]])
    table = [line for line in markdown(grid).splitlines() if line.startswith("|")]
    assert len(set(map(len, table))) == 1
    assert r"M3\_x & \textbf{$-$0.1} \\" in latex(grid, "50% & more")
    assert r"\caption{50\% \& more}" in latex(grid, "50% & more")
