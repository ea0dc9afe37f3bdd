"""The commands keep Hydra's own habits, and hand a sweeper their objective."""

import json
import logging
import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from importlib import import_module
from pathlib import Path

import pytest

from symshrec.cli import main
from symshrec.runs.command import entry

ROOT = Path(__file__).parents[2]
SWEEPER = '''
from hydra.core.config_store import ConfigStore
from hydra.core.plugins import Plugins
from hydra.plugins.sweeper import Sweeper

class Two(Sweeper):
    """Tries two values and prints the objective of each."""
    def setup(self, *, hydra_context, task_function, config):
        self.launcher = Plugins.instance().instantiate_launcher(
            hydra_context=hydra_context, task_function=task_function, config=config)
    def sweep(self, arguments):
        jobs = [[*arguments, f"method.neighbours={k}", f"folder=k{k}"] for k in (20, 40)]
        print("objectives", *(each.return_value for each in self.launcher.launch(jobs, 0)))

ConfigStore.instance().store("two", {"_target_": f"{__name__}.Two"}, group="hydra/sweeper", provider="test")
'''


@pytest.fixture(autouse=True)
def logging_as_it_was():
    handlers, level = list(logging.root.handlers), logging.root.level
    yield
    logging.root.handlers[:] = handlers
    logging.root.setLevel(level)


@pytest.fixture
def own(tmp_path) -> Path:
    """A folder with an experiment and a primary file of a user's own."""
    folder = tmp_path / "own"
    (folder / "experiment").mkdir(parents=True)
    (folder / "experiment" / "mine.yaml").write_text("# @package _global_\nseed: 77\n")
    (folder / "main.yaml").write_text("defaults: [config, _self_]\nseed: 78\n")
    return folder


@pytest.mark.parametrize("command", ["generate", "train", "evaluate", "tables", "bench", "figures"])
def test_every_command_composes_with_a_folder_of_the_user(command, own, capsys):
    import_module(f"symshrec.cli.{command}").command(["--config-dir", str(own), "experiment=mine", "--cfg", "job"])
    assert "\nseed: 77\n" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "shown"),
    [
        (["hydra.searchpath=[file://{own}]", "experiment=mine", "--cfg", "job"], "\nseed: 77\n"),
        (["--config-dir", "{own}", "--config-name", "main", "--cfg", "job"], "\nseed: 78\n"),
        (["--config-dir", "{own}", "--info", "searchpath"], "file://{own}"),
        (["--shell-completion", "install=bash"], "hydra_bash_completion symshrec"),
        (["--cfg", "job", "--package", "trainer", "+trainer.fast_dev_run=true"], "fast_dev_run: true"),
        (["--cfg", "job", "--package", "logger", "logger=[csv,tensorboard]"], "CSVLogger"),
        (["--help"], "fingerprint: arc_length"),
    ],
)
def test_options_of_hydra_work(words, shown, own, capsys):
    before = list(sys.argv)
    with suppress(SystemExit):  # as argparse ends after --help
        main(["evaluate", *(word.format(own=own) for word in words)])
    assert shown.format(own=own) in capsys.readouterr().out
    assert sys.argv == before


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (["--config-dir", "nowhere"], "symshrec evaluate: there is no folder nowhere"),
        (["trainer.fast_dev_run=true"], "needs a plus: +trainer.fast_dev_run="),
        (["method=m4", "method.neighbors=3"], "unknown key 'method.neighbors'; valid here: calibration"),
        (["--multirun", "experiment=glob(nothing*)"], "the sweep experiment=glob(nothing*) matches nothing"),
        (["--multirun", "run=m3_r1,k251"], "Could not find 'run/k251'"),
    ],
)
def test_a_mistake_is_named_before_anything_runs(words, line, capsys):
    with pytest.raises(SystemExit) as end:
        main(["evaluate", *words])
    assert end.value.code == 2
    told = capsys.readouterr()
    assert line in told.err
    assert "Traceback" not in told.err
    assert not told.out


def test_what_only_some_sweepers_can_sweep_is_left_to_them(tmp_path, monkeypatch, capsys):
    """Hydra's own sweeper says that it cannot; the check before it does not."""
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit):
        entry(lambda config: None)(["--multirun", "method.count_threshold=interval(0,1)"], "symshrec evaluate")
    assert "BasicSweeper does not support sweep type : INTERVAL_SWEEP" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("line", "answer"),
    [
        ("symshrec ev", "evaluate"),
        ("symshrec evaluate trainer.dev", "trainer.devices="),
        ("symshrec generate data=smo", "data=smoke"),
        ("symshrec detect cha", ""),
    ],
)
def test_a_shell_completes_commands_and_their_settings(line, answer, monkeypatch, capsys):
    monkeypatch.setenv("COMP_LINE", line)
    assert main(["-sc", "query=bash"]) == 0
    assert capsys.readouterr().out.strip() == answer


@pytest.fixture
def smoke_command(small_benchmark, smoke_root):
    def words(command: str, *overrides: str) -> list[str]:
        quiet = ["trainer.enable_progress_bar=false", "logger=none", f"data.root={smoke_root}"]
        return [sys.executable, "-m", "symshrec", command, *overrides, *small_benchmark, *quiet]

    return words


def test_a_sweeper_is_given_the_map_from_processes_of_joblib(smoke_command, tmp_path):
    plugins = tmp_path / "hydra_plugins"
    plugins.mkdir()
    (plugins / "two.py").write_text(SWEEPER)
    environment = os.environ | {"PYTHONPATH": f"{ROOT}{os.pathsep}{tmp_path}"}
    sweep = ["--multirun", "hydra/sweeper=two", "hydra/launcher=joblib", "hydra.launcher.n_jobs=2", "data.limit=4"]
    sweep += ["method.workers=2"]
    command = smoke_command("evaluate", *sweep)
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    (line,) = [line for line in done.stdout.splitlines() if line.startswith("objectives")]
    assert [float(each) for each in line.split()[1:]] == [stored_map(tmp_path / f"k{k}") for k in (20, 40)]


def stored_map(folder: Path) -> float:
    rows = json.loads((folder / "metrics.json").read_text())["scores"]
    return next(row["value"] for row in rows if (row["metric"], row["group"]) == ("mAP", "all"))


SLOW = """
import time
from symshrec.methods import MethodSettings, SymmetryMethod
from symshrec.planes import Planes

class Slow(SymmetryMethod):
    Settings = MethodSettings
    version = 1

    def detect(self, points):
        time.sleep(3)  # so that Ctrl-C comes while it is at work
        return Planes.empty()
"""


def test_ctrl_c_leaves_one_line(smoke_command, tmp_path):
    (tmp_path / "slow.py").write_text(SLOW)
    run = tmp_path / "run"
    command = smoke_command("evaluate", "method=slow.Slow", f"folder={run}", "data.batch_size=1")
    environment = os.environ | {"PYTHONPATH": f"{ROOT}{os.pathsep}{tmp_path}"}
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs ignore it
    try:
        process = subprocess.Popen(
            command, cwd=ROOT, env=environment, stderr=subprocess.PIPE, text=True, start_new_session=True
        )
    finally:
        signal.signal(signal.SIGINT, before)
    deadline = time.monotonic() + 120
    while not list(run.glob("predictions/part-*")) and time.monotonic() < deadline and process.poll() is None:
        time.sleep(0.02)
    os.killpg(process.pid, signal.SIGINT)
    told = process.communicate()[1]
    assert (process.returncode, told) == (130, "symshrec evaluate: interrupted\n")
