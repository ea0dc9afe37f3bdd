"""The package inside other people's programs: their Hydra application, their threads, their forks."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import symshrec
from symshrec.methods import MethodSettings
from symshrec.methods.base import SymmetryMethod
from symshrec.planes import Planes
from symshrec.runs.config import as_overrides, load

ROOT = Path(__file__).parents[1]
CLOUD = "points = np.random.default_rng(0).normal(size=(300, 3)) * [1, 2, 3]\n"

HYDRA_APP = """
import hydra, numpy as np
from hydra import compose, initialize_config_dir
from hydra.core.config_store import ConfigStore
from hydra.core.global_hydra import GlobalHydra
import symshrec
from symshrec.runs.config import load
ConfigStore.instance().store("schema", {"theirs": 1})
ConfigStore.instance().store("m4", {"theirs": 1}, group="method")
ConfigStore.instance().store("config", {"defaults": ["schema"], "answer": "${hydra:job.name}"})
POINTS
@hydra.main(version_base="1.2", config_path=None, config_name="config")
def app(config):
    mine = GlobalHydra.instance().hydra
    assert mine is not None
    assert len(symshrec.detect(points, neighbours=13)) > 0
    assert load(["data=smoke"]).data.name == "smoke"
    assert GlobalHydra.instance().hydra is mine
    assert hydra.version.getbase().minor == 2
    assert compose("config").theirs == 1
    assert (config.theirs, config.answer) == (1, "app")
    print("both work")
app()
"""
THREADS = """
import threading, numpy as np
import symshrec
POINTS
start, found = threading.Barrier(8), []
def work(number):
    start.wait()
    found.append((number % 2, symshrec.detect(points, "m4", neighbours=12 + number % 2)))
threads = [threading.Thread(target=work, args=(number,)) for number in range(8)]
[each.start() for each in threads]; [each.join() for each in threads]
for odd in (0, 1):
    one, *others = [planes for kind, planes in found if kind == odd]
    assert len(others) == 3 and all((each.normals == one.normals).all() for each in others)
print("both work")
"""
FORK = """
import os, signal, sys, numpy as np, torch
import symshrec
POINTS
torch.set_num_threads(4)
torch.randn(2_000_000).exp().sum()  # starts the threads that a child does not have
symshrec.detect(points, "m1", max_points=1024)
child = os.fork()
if child == 0:
    signal.alarm(100)
    planes = symshrec.detect(torch.from_numpy(np.tile(points, (200, 1))), "m1")
    os._exit(0 if len(planes.normals) else 3)
assert os.waitpid(child, 0)[1] == 0
print("both work")
"""


@pytest.mark.parametrize("program", [HYDRA_APP, THREADS, pytest.param(FORK, marks=pytest.mark.skipif(
    not hasattr(os, "fork"), reason="no fork"))], ids=["hydra", "threads", "fork"])  # fmt: skip
def test_detect_works_there(program, tmp_path):
    file = tmp_path / "app.py"
    file.write_text(program.replace("POINTS", CLOUD))
    environment = os.environ | {"PYTHONPATH": str(ROOT), "HYDRA_FULL_ERROR": "1"}
    command = [sys.executable, str(file)]
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert done.stdout == "both work\n", done.stderr


class Nothing(SymmetryMethod):
    """Finds one plane, x = 0, wherever it looks."""

    seen = 0

    def detect(self, points):
        type(self).seen += 1
        return Planes(np.array([[1.0, 0, 0]]), np.zeros((1, 3)))


@pytest.fixture
def quick(small_benchmark, smoke_root, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    more = {"data": {"root": smoke_root, "limit": 4}, "logger": "none", "trainer": {"enable_progress_bar": False}}
    return small_benchmark, more


def test_evaluate_from_python_is_the_run_of_the_command(quick, tmp_path):
    overrides, more = quick
    result = symshrec.evaluate(*overrides, method="m3", run="m3_r2", **more | {"method.neighbours": 20})
    assert result["name"] == "M3 (R2)"
    folder = tmp_path / "runs/smoke/m3_r2" / "data.benchmark.clouds_per_shard=10"
    assert [path for path in tmp_path.rglob("metrics.json") if str(path).startswith(str(folder))]
    again = symshrec.evaluate(*overrides, method="m3", run="m3_r2", **more | {"method.neighbours": 20})
    assert again == result


def test_a_ready_method_is_evaluated_and_known_again(quick, tmp_path):
    overrides, more = quick
    result = symshrec.evaluate(*overrides, method=Nothing(), folder=tmp_path / "here", **more)
    assert (result["name"], result["method"], result["data"]["clouds"]) == ("Nothing", "nothing", 4)
    assert (tmp_path / "here" / "metrics.json").exists()
    symshrec.evaluate(*overrides, method=Nothing(MethodSettings(count_threshold=0.4)), folder=tmp_path / "here", **more)
    assert Nothing.seen == 4  # another threshold scores again, and detects nothing again
    with pytest.raises(ValueError, match="method is a float; give the name of one, or a SymmetryMethod"):
        symshrec.evaluate(method=1.5)
    with pytest.raises(ValueError, match="unknown key 'dota'"):
        symshrec.evaluate(dota="smoke")


def test_train_from_python_says_what_the_command_says():
    with pytest.raises(ValueError, match="method=m3 has nothing to train"):
        symshrec.train(data="smoke", folder="nowhere")


def test_settings_become_overrides_that_compose():
    settings = {"title": "it's M3, {new} = 1", "seed": 3, "data": {"families": ["citrus", "astroid"], "limit": None}}
    config = load(as_overrides(settings | {"tables": None}))
    assert (config.title, config.seed) == ("it's M3, {new} = 1", 3)
    assert (list(config.data.families), config.data.limit) == (["citrus", "astroid"], None)
    with pytest.raises(ValueError, match="seed is a object"):
        as_overrides({"seed": object()})
