"""Sweeps as job arrays of a real SLURM, where there is one. It may be this machine alone:

    experiments/slurm/one_node.sh run FOLDER python -m pytest tests/runs/test_slurm.py

On a cluster, `--basetemp` names a folder that its machines share.
"""

import json
import os
import shutil
import subprocess
import sys
import time
from importlib.util import find_spec
from pathlib import Path

import pytest

from symshrec.benchmark.generate import generate_dataset
from symshrec.runs.checkpoints import steps_done
from symshrec.runs.config import benchmark_of, load
from symshrec.runs.train import train
from tests.runs.test_command import SWEEPER, stored_map
from tests.runs.test_train import TINY, assert_equal_weights

ROOT = Path(__file__).parents[2]


def answer(*command: str) -> str:
    return subprocess.run(command, capture_output=True, text=True, check=True, timeout=20).stdout


def lacking() -> str | None:
    """What is missing for these tests."""
    if not shutil.which("sbatch"):
        return "there is no SLURM here; experiments/slurm/one_node.sh makes one"
    try:
        answer("sinfo")
    except subprocess.SubprocessError:
        return "SLURM is installed, but sinfo gets no answer; experiments/slurm/one_node.sh starts it"
    if not (find_spec("hydra_plugins") and find_spec("hydra_plugins.hydra_submitit_launcher")):
        return "pip install 'symshrec[slurm]'"
    return None


pytestmark = pytest.mark.skipif(lacking() is not None, reason=str(lacking()))


@pytest.fixture
def sweep(tmp_path):
    """(command, overrides) → the process of a sweep on SLURM."""

    def start(command: str, *overrides: str) -> subprocess.Popen:
        words = [command, "--multirun", *overrides, "hydra/launcher=submitit_slurm", "hydra.launcher.timeout_min=30"]
        environment = os.environ | {"PYTHONPATH": f"{ROOT}{os.pathsep}{tmp_path}", "OMP_NUM_THREADS": "1"}
        return subprocess.Popen(
            [sys.executable, "-m", "symshrec", *words], cwd=tmp_path, env=environment, stdout=subprocess.PIPE, text=True
        )

    return start


def finish(process: subprocess.Popen) -> str:
    printed = process.communicate(timeout=600)[0]
    assert process.returncode == 0
    return printed


def logs(folder: Path) -> list[str]:
    return [path.read_text() for path in sorted(folder.glob("runs/.submitit/*_*/*.out"))]


def contents(root: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in root.iterdir()}


def test_an_array_makes_what_one_process_makes(sweep, small_benchmark, tmp_path):
    finish(sweep("generate", *small_benchmark, "data.root=made", "workers=1", "part=1/4,2/4,3/4,4/4"))
    assert [f"part {number} of 4" in log for number, log in enumerate(logs(tmp_path), 1)] == [True] * 4
    before = {path.name: path.stat().st_mtime_ns for path in (tmp_path / "made").glob("*.safetensors")}
    for root in (tmp_path / "made", tmp_path / "whole"):
        generate_dataset(benchmark_of(load(small_benchmark)), root, progress=False)
    assert contents(tmp_path / "made") == contents(tmp_path / "whole")
    assert before == {path.name: path.stat().st_mtime_ns for path in (tmp_path / "made").glob("*.safetensors")}


def test_a_sweeper_is_given_the_map_of_evaluations(sweep, small_benchmark, smoke_root, tmp_path):
    (tmp_path / "hydra_plugins").mkdir()
    (tmp_path / "hydra_plugins" / "two.py").write_text(SWEEPER)
    quiet = ["trainer.enable_progress_bar=false", "logger=none", "data.limit=4", "hydra/sweeper=two"]
    printed = finish(sweep("evaluate", *small_benchmark, *quiet, f"data.root={smoke_root}"))
    (line,) = [line for line in printed.splitlines() if line.startswith("objectives")]
    assert [float(each) for each in line.split()[1:]] == [stored_map(tmp_path / f"k{k}") for k in (20, 40)]


def test_five_folds_side_by_side(sweep, small_benchmark, smoke_root, tmp_path):
    finish(sweep("train", *small_benchmark, f"data.root={smoke_root}", *TINY, "data.fold=0,1,2,3,4"))
    records = [json.loads(path.read_text()) for path in tmp_path.glob("runs/smoke/training/*/training.json")]
    assert sorted(each["fold"] for each in records) == [0, 1, 2, 3, 4]
    assert any("folds 0, 1, 2, 3, 4: " in log for log in logs(tmp_path))


def test_a_training_that_slurm_queues_again_ends_with_the_same_weights(sweep, small_benchmark, smoke_config, tmp_path):
    long = [*TINY, "train.epochs=24", "train.steps_per_round=96", "train.checkpoint_minutes=0"]
    whole, cut = (smoke_config(*long, f"train.folder={tmp_path / name}") for name in ("whole", "cut"))
    process = sweep("train", *small_benchmark, f"data.root={cut.data.root}", *long, f"train.folder={cut.train.folder}")
    deadline = time.monotonic() + 300
    while not (tmp_path / "cut" / "previous.ckpt").exists():
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.01)
    (job,) = answer("squeue", "--noheader", "--format=%i", "--name=train").split()
    answer("scontrol", "requeue", job)
    assert 0 < steps_done(tmp_path / "cut") < 96
    while "PENDING" not in answer("squeue", "--noheader", "--format=%T", f"--jobs={job}"):
        time.sleep(0.2)
    answer("scontrol", "update", f"JobId={job}", "StartTime=now")  # SLURM waits for two minutes else
    finish(process)
    (log,) = tmp_path.glob("runs/.submitit/*/*.out")
    assert log.read_text().count("Starting with JobEnvironment") == 2
    train(whole)
    assert_equal_weights(whole, cut)
