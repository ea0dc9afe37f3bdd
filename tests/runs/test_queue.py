"""Sweeps whose jobs submitit runs: on this machine, by its local launcher, which needs no SLURM."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from symshrec.benchmark.generate import generate_dataset
from symshrec.cli import main
from symshrec.runs import queue
from symshrec.runs.config import benchmark_of, load

ROOT = Path(__file__).parents[2]
PROGRAM = '''
"""A command whose job gets SIGUSR2 with all its processes, as at the end of its time: so often as `workers` says."""
import os, signal, time
from pathlib import Path
from symshrec.runs.command import entry

@entry
def command(config):
    folder = Path(config.folder)
    folder.mkdir(exist_ok=True)
    begun = len(list(folder.glob("begun*")))
    (folder / f"begun{begun}").touch()
    if begun == config.workers:
        print("ended with HYDRA_FULL_ERROR", os.environ.get("HYDRA_FULL_ERROR"))
        return
    if config.seed == 0:  # ended by Lightning after SIGTERM
        if not os.fork():
            time.sleep(1)
            os.kill(os.getppid(), signal.SIGUSR2)
            os._exit(0)
        raise SystemExit
    end, other = os.pipe()
    if child := os.fork():
        os.close(other)
        os.waitpid(child, 0)
        (folder / f"child{begun}").write_bytes(os.read(end, 9))
        os.kill(os.getpid(), signal.SIGUSR2)
    else:
        os.kill(os.getpid(), signal.SIGUSR2)
        os.write(other, b"goes on")
        os._exit(0)
'''


def run(folder: Path, *words: str) -> subprocess.CompletedProcess:
    environment = os.environ | {"PYTHONPATH": f"{ROOT}{os.pathsep}{folder}"}
    environment.pop("HYDRA_FULL_ERROR", None)
    command = [sys.executable, *words, "hydra/launcher=submitit_local"]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)


@pytest.fixture
def submitit():
    pytest.importorskip("hydra_plugins.hydra_submitit_launcher", reason="pip install 'symshrec[slurm]'")


@pytest.mark.parametrize(
    ("launcher", "extra"), [("joblib", "launchers"), ("submitit_slurm", "slurm"), ("submitit_local", "slurm")]
)
def test_a_launcher_that_is_not_installed_is_named_with_its_extra(launcher, extra, monkeypatch, capsys):
    monkeypatch.setattr(queue, "find_spec", lambda module: None)
    with pytest.raises(SystemExit) as end:
        main(["generate", "--multirun", "data=smoke", "part=1/2,2/2", f"hydra/launcher={launcher}"])
    assert end.value.code == 2
    assert capsys.readouterr().err == (
        f"symshrec generate: hydra/launcher={launcher} is not installed; pip install 'symshrec[{extra}]'\n"
    )


def test_slurm_is_missed_before_anything_runs(submitit, monkeypatch, capsys, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(SystemExit) as end:
        main(["generate", "--multirun", "data=smoke", "part=1/2,2/2", "hydra/launcher=submitit_slurm"])
    assert end.value.code == 2
    assert "SLURM's sbatch and srun, which are not on the PATH; call it on a machine of" in capsys.readouterr().err


def test_jobs_make_their_parts_and_a_mistake_in_one_is_a_line(submitit, small_benchmark, tmp_path):
    words = ["generate", "--multirun", *small_benchmark, "part=1/1,2/1", "workers=1", "data.root=made"]
    done = run(tmp_path, "-m", "symshrec", *words)
    assert done.returncode == 2
    *_, job, line = done.stderr.splitlines()
    assert "'part=2/1'" in job
    assert line == "symshrec generate: part is 2/1; it must be K/N with K from 1 to N, such as 2/8, or all"
    (log,) = [path for path in tmp_path.glob("runs/.submitit/*/*.err") if path.read_text()]
    assert log.read_text() == f"{line}\n"
    whole = tmp_path / "whole"
    for root in (tmp_path / "made", whole):
        generate_dataset(benchmark_of(load(small_benchmark)), root, progress=False)
    assert {path.name: path.read_bytes() for path in (tmp_path / "made").iterdir()} == {
        path.name: path.read_bytes() for path in whole.iterdir()
    }


@pytest.mark.parametrize(("minutes", "times", "status"), [(60, 1, 0), (1, 9, 2)])
def test_a_job_whose_time_is_over_is_queued_again_by_one_process_alone(submitit, minutes, times, status, tmp_path):
    """Preempted once; then out of time so often that submitit, at the fourth, ends it."""
    (tmp_path / "own.py").write_text(PROGRAM)
    call = "import own; own.command(name='own')"
    words = ["--multirun", "data=smoke", "folder=run", f"workers={times}", f"hydra.launcher.timeout_min={minutes}"]
    done = run(tmp_path, "-c", call, *words)
    assert done.returncode == status, done.stderr
    signalled = [path.read_text() for path in sorted(tmp_path.glob("run/child*"))]
    assert signalled == ["goes on"] * (1 if status == 0 else 4)
    (log,) = tmp_path.glob("runs/.submitit/*/*_0_log.out")
    assert ("ended with HYDRA_FULL_ERROR None" in log.read_text()) == (status == 0)
    assert ("own: the time of this job was over, hydra.launcher.timeout_min; " in done.stderr) == (status == 2)
    assert "Traceback" not in done.stderr


def test_a_job_that_sigterm_would_end_waits_to_be_queued_again(submitit, tmp_path):
    (tmp_path / "own.py").write_text(PROGRAM)
    done = run(tmp_path, "-c", "import own; own.command(name='own')", "--multirun", "folder=run", "workers=1", "seed=0")
    assert (done.returncode, len(list(tmp_path.glob("run/begun*")))) == (0, 2), done.stderr
