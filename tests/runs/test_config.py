"""Every configuration composes; a wrong key or value fails at once and names the right ones."""

import subprocess
import sys
from pathlib import Path

import pytest
from omegaconf import OmegaConf

from symshrec.benchmark.cloud import HARD_PERTURBATIONS, SCAN_PERTURBATIONS
from symshrec.benchmark.config import check_config
from symshrec.methods.oracle.settings import OracleSettings
from symshrec.methods.registry import BUILT_IN, settings_class
from symshrec.methods.settings import plain_settings
from symshrec.runs.config import benchmark_of, conf_folder, load, method_of, table_rows
from symshrec.runs.evaluate import datamodule_of

ROOT = Path(__file__).parents[2]
FILES = sorted(path.relative_to(conf_folder()) for path in conf_folder().glob("*/*.yaml"))
RUNS = {path.stem: path.stem.partition("_")[0] for path in (conf_folder() / "run").glob("*.yaml")}  # of which method
RUNS["pca_icp"] = "pca_icp"
NEEDS = {f"run/{run}": [f"method={method}"] for run, method in RUNS.items()}
NEEDS |= {f"data/{name}": ["data.root=somewhere"] for name in ("official", "clouds")}


@pytest.mark.parametrize("file", FILES, ids=str)
def test_every_file_composes_and_instantiates(file):
    name = file.with_suffix("")
    config = load([f"{name.parent}={name.name}", *NEEDS.get(str(name), [])])
    method_of(config)
    datamodule_of(config)
    OmegaConf.to_yaml(OmegaConf.masked_copy(config, [key for key in config if key != "folder"]), resolve=True)
    if config.data.benchmark.splits:
        check_config(benchmark_of(config))


def test_data_have_their_sizes_their_perturbations_evenly_and_others_beside_them():
    sizes = {"smoke": 84, "quick": 4620, "paper": 69_000, "x10": 690_000, "hard": 3600, "hard_quick": 84}
    sizes |= {"scan": 7200, "scan_quick": 84, "planeless": 1200, "planeless_quick": 84}
    configs = {scale: load([f"data={scale}"]) for scale in sizes}
    splits = {scale: benchmark_of(config).splits for scale, config in configs.items()}
    assert {scale: sum(each.clouds for each in own.values()) for scale, own in splits.items()} == sizes
    for scale, names, clouds in (
        ("hard", HARD_PERTURBATIONS, 900),
        ("hard_quick", HARD_PERTURBATIONS, 21),
        ("scan", SCAN_PERTURBATIONS, 600),
        ("scan_quick", SCAN_PERTURBATIONS, 14),
    ):
        assert splits[scale]["test"].perturbations == dict.fromkeys(names, clouds)
        assert splits[scale]["test"].families is None
    for scale, hard, scan in (("paper", "hard", "scan"), ("quick", "hard_quick", "scan_quick")):
        assert (configs[scale].data.hard, configs[scale].data.scan) == (hard, scan)


@pytest.mark.parametrize("overrides", [["run=m3_r2", "method.refine=true"], ["experiment=m3_r2", "method.refine=true"]])
def test_a_refined_run_has_a_name_and_a_row_of_its_own(overrides):
    plain, refined = load(["run=m3_r2"]), load(overrides)
    assert (plain.name, plain.title) == ("m3_r2", "M3 (R2)")
    assert (refined.name, refined.title) == ("m3_r2_refine", "M3 (R2) + refine")
    assert not method_of(plain).refine
    assert method_of(refined).refine


def test_a_row_has_one_name_in_commands_folders_and_the_list_of_rows():
    config = load()
    rows = config.rows
    for name in {*rows.published, *rows.ours, *rows.refined, *rows.so3, "oracle"}:
        row = load([f"experiment={name}", "method.refine=false"])
        assert row.name == name
        assert (list(row.tolerance.thetas_deg), list(row.tolerance.epsilons)) == ([1.0, 0.1], [0.01, 0.001])
        assert load([f"experiment={name}", "method.refine=true"]).name == f"{name}_refine"
    assert load(["experiment=oracle"]).name == table_rows(config)[-1] == "oracle_refine"
    assert set(rows.refined) < {*rows.published, *rows.ours}
    assert set(rows.so3_refined) < set(rows.so3)
    experiments = {path.stem for path in (conf_folder() / "experiment").glob("*.yaml")}
    listed = {*rows.published, *rows.ours, *rows.so3, "oracle"}
    assert {name for name in experiments if not name.endswith("_cpu")} == listed
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
    command = [sys.executable, "-m", "symshrec", "tables", "--multirun", "run=m3_r1,k251"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.startswith("symshrec tables: In 'config': Could not find 'run/k251'")
    assert "Traceback" not in done.stderr
    assert "Launching" not in done.stdout


@pytest.mark.parametrize("name", BUILT_IN)
def test_a_method_has_the_defaults_of_its_settings_alone(name):
    """conf/ adds none of its own, but for what a run selects."""
    plain = plain_settings(settings_class(name)()) | {"name": name}
    node = load([f"method={name}"] if name != "m2_pretrain" else ["method=m2", "run=m2_pretrain"]).method
    settings = plain_settings(OmegaConf.to_object(node))
    chosen = {"m1": {"weights": ["m1_r4"]}, "m2": {"weights": ["m2"]}, "m2_pretrain": {}}
    assert settings == plain | chosen.get(name, {})


def test_the_oracle_is_refined_from_beside_the_truth():
    settings = method_of(load(["experiment=oracle"])).settings
    assert settings == OracleSettings()
    assert settings.refine
    assert min(settings.angle_deg, 100 * settings.offset) > 0.1  # the tight table's: where it stays, it does not count
