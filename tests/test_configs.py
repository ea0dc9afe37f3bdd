"""Every configuration composes; a wrong key or value fails at once and names the right ones."""

import subprocess
import sys
from pathlib import Path

import pytest
from omegaconf import OmegaConf

from symshrec.benchmark.config import check_config
from symshrec.configs import benchmark_of, conf_folder, load
from symshrec.evaluation import datamodule_of, method_of

ROOT = Path(__file__).parents[1]
FILES = sorted(path.relative_to(conf_folder()) for path in conf_folder().glob("*/*.yaml"))
NEEDS = {"data/official": ["data.root=somewhere"]}


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
    sizes = {"smoke": 84, "quick": 4830, "paper": 69_000, "x10": 690_000}
    for scale, clouds in sizes.items():
        splits = benchmark_of(load([f"data={scale}"])).splits
        assert sum(each.clouds for each in splits.values()) == clouds


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("data=quik", "Available options in 'data':\n\tfingerprint\n\tofficial\n\tpaper\n\tquick"),
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
