"""Every configuration composes; a wrong key or value fails at once and names the right ones."""

import subprocess
import sys
from pathlib import Path

import pytest
from omegaconf import OmegaConf

from symshrec.benchmark.cloud import HARD_PERTURBATIONS, SCAN_PERTURBATIONS
from symshrec.benchmark.config import check_config
from symshrec.methods.baselines.pca_icp import PcaIcpSettings
from symshrec.methods.baselines.ransac import RansacSettings
from symshrec.methods.m3.pipeline import M3Settings
from symshrec.methods.m4.pipeline import M4Settings
from symshrec.methods.oracle import Truth
from symshrec.runs.config import benchmark_of, conf_folder, load
from symshrec.runs.evaluate import datamodule_of, method_of

ROOT = Path(__file__).parents[2]
FILES = sorted(path.relative_to(conf_folder()) for path in conf_folder().glob("*/*.yaml"))
RUNS = {
    "m1": ("m1", "m1_cpu", "r1", "r2", "r3", "r4", "r5", "r4_so3", "r1_plus", "r2_plus"),
    "m2": ("m2", "m2_cpu", "published", "confidence", "pretrain"),
    "m4": ("m4", "sharp", "fast"),
    "pca_icp": ("pca_icp", "pca_icp_plain"),
    "ransac": ("ransac", "ransac_plain"),
    "truth": ("truth", "near", "exact"),
}  # of which method; the others are m3's
NEEDS = {f"run/{run}": [f"method={method}"] for method, runs in RUNS.items() for run in runs}
NEEDS |= {f"data/{name}": ["data.root=somewhere"] for name in ("official", "clouds")}
M1_ROWS = ("m1_r1", "m1_r2", "m1_r3", "m1_r4")
REFINED = (*M1_ROWS, "m2", "m3_r1", "m3_r2", "m1_r5", "m2_confidence")
ROWS = (*REFINED, "pca_icp", "ransac", "m4", "m4_fast", *(f"{row}_refine" for row in REFINED), "oracle")
SO3_ROWS = ("m1_r4", "m1_r4_so3", "m3_r1", "m4", "m1_r4_so3_refine")


@pytest.mark.parametrize("file", FILES, ids=str)
def test_every_file_composes_and_instantiates(file):
    name = file.with_suffix("")
    config = load([f"{name.parent}={name.name}", *NEEDS.get(str(name), [])])
    method_of(config)
    datamodule_of(config)
    OmegaConf.to_yaml(OmegaConf.masked_copy(config, [key for key in config if key != "folder"]), resolve=True)
    if config.data.benchmark.splits:
        check_config(benchmark_of(config))


def test_scales_have_the_published_sizes():
    sizes = {"smoke": 84, "quick": 4830, "paper": 69_000, "x10": 690_000, "hard": 3600, "hard_quick": 84}
    sizes |= {"scan": 7200, "scan_quick": 84, "planeless": 1200, "planeless_quick": 84}
    for scale, clouds in sizes.items():
        splits = benchmark_of(load([f"data={scale}"])).splits
        assert sum(each.clouds for each in splits.values()) == clouds


def test_hard_and_scan_data_have_their_perturbations_evenly_and_stand_beside_their_scale():
    for name, names, each in (
        ("hard", HARD_PERTURBATIONS, 900),
        ("hard_quick", HARD_PERTURBATIONS, 21),
        ("scan", SCAN_PERTURBATIONS, 600),
        ("scan_quick", SCAN_PERTURBATIONS, 14),
    ):
        splits = benchmark_of(load([f"data={name}"])).splits
        assert splits["test"].perturbations == dict.fromkeys(names, each)
        assert splits["test"].families is None
    assert load(["data=paper"]).data.hard == "hard"
    assert load(["data=quick"]).data.hard == "hard_quick"
    assert load(["data=paper"]).data.scan == "scan"
    assert load(["data=quick"]).data.scan == "scan_quick"


@pytest.mark.parametrize("overrides", [["run=k250", "method.refine=true"], ["experiment=m3_r2_refine"]])
def test_a_refined_run_has_a_name_and_a_row_of_its_own(overrides):
    plain, refined = load(["run=k250"]), load(overrides)
    assert (plain.name, plain.title) == ("m3_k250", "M3 (R2)")
    assert (refined.name, refined.title) == ("m3_k250_refine", "M3 (R2) + refine")
    assert not method_of(plain).refine
    assert method_of(refined).refine


def test_the_rows_of_the_tables_are_runs_of_experiments_scored_at_both_tolerances():
    rows = [load([f"experiment={name}"]) for name in ROWS]
    turned = [load([f"experiment={name}", "pose=so3"]) for name in SO3_ROWS]
    assert [row.name for row in rows] == list(rows[0].tables)
    assert [row.name for row in turned] == list(rows[0].tables_so3)
    for row in rows + turned:
        assert (list(row.tolerance.thetas_deg), list(row.tolerance.epsilons)) == ([1.0, 0.1], [0.01, 0.001])
    assert len(load(["experiment=m3_r1", "tolerance=sweep"]).tolerance.epsilons) == 10


@pytest.mark.parametrize(
    ("override", "message"),
    [
        (
            "data=quik",
            "Available options in 'data':\n\tclouds\n\tfingerprint\n\thard\n\thard_quick\n\tofficial",
        ),
        ("run=k300", "Available options in 'run'"),
        ("method.neighbors=200", "unknown key 'method.neighbors'; valid here: .*neighbours"),
        ("data.benchmark.nois.shift=scalar", "unknown key 'data.benchmark.nois'; valid here: .*noise"),
        ("toleranse=sweep", "unknown key 'toleranse'; valid here: .*tolerance"),
        ("data.benchmark.pose.group=full", "expected one of .track, so3, xy_axes, none"),
        ("method.neighbours=many", "method.neighbours"),
    ],
)
def test_mistakes_name_the_valid_keys_and_values(override, message):
    with pytest.raises(ValueError, match=message):
        load([override])


def test_a_sweep_with_one_bad_value_fails_before_its_first_job():
    command = [sys.executable, "experiments/tables.py", "--multirun", "run=k200,k251"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.startswith("error: In 'config': Could not find 'run/k251'")
    assert "Traceback" not in done.stderr
    assert "Launching" not in done.stdout


@pytest.mark.parametrize(
    ("method", "settings"),
    [("m3", M3Settings()), ("m4", M4Settings()), ("pca_icp", PcaIcpSettings()), ("ransac", RansacSettings())],
)
def test_the_schema_and_the_code_have_the_same_defaults(method, settings):
    assert method_of(load([f"method={method}"])).settings == settings


def test_the_oracle_is_refined_from_beside_the_truth():
    oracle, default = method_of(load(["experiment=oracle"])), Truth()
    assert (oracle.angle_deg, oracle.offset, oracle.refine) == (default.angle_deg, default.offset, default.refine)
    assert min(oracle.angle_deg, 100 * oracle.offset) > 0.1  # the tight table's: where it stays, it does not count
