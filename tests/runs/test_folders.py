"""A folder has one writer at a time, and results of one folder of data."""

import os
import shutil
import signal
import subprocess
import sys

import pytest

from symshrec.benchmark.generate import generate_dataset
from symshrec.files.atomic import FolderInUseError, sole_writer
from symshrec.runs.config import benchmark_of, load
from symshrec.runs.evaluate import evaluate
from symshrec.runs.train import train

HOLD = """
import os, sys, time
from pathlib import Path
from symshrec.files.atomic import sole_writer
with sole_writer(Path(sys.argv[1])):
    if os.fork() == 0:  # a worker that outlives a killed writer
        time.sleep(0.2)
        print("held", flush=True)
        time.sleep(60)
        os._exit(0)
    time.sleep(60)
"""
TINY = ["method=m1", "run=m1_r4", "method.network.points=16", "method.network.channels=8", "method.network.layers=1"]
TINY += ["method.network.features=8", "method.network.hidden=[8,8]", "method.loss.head_points=8"]
TINY += ["train.batch_size=8", "train.steps_per_round=2", "train.epochs=0.5", "train.clouds_shown=0"]


@pytest.fixture
def other_root(tmp_path, small_benchmark):
    """The smoke benchmark by another seed, under the same name."""
    root = tmp_path / "other" / "smoke"
    generate_dataset(benchmark_of(load([*small_benchmark, "data.benchmark.seed=7"])), root, workers=1, progress=False)
    return root


@pytest.mark.parametrize("command", [evaluate, train])
def test_a_folder_in_use_is_refused_at_once_by_name_and_process(command, smoke_config, tmp_path):
    folder = tmp_path / "held"
    extra = TINY if command is train else ["data.limit=2"]
    config = smoke_config(*extra, f"train.folder={folder}", f"folder={folder}")
    message = rf"{folder}: another process is writing here \(pid {os.getpid()}\); wait for it, or give another folder"
    with sole_writer(folder), pytest.raises(FolderInUseError, match=message):
        command(config)
    assert not list(folder.iterdir())
    assert command(config)


def test_a_kill_releases_a_folder_whatever_workers_it_leaves(tmp_path):
    process = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(tmp_path)], stdout=subprocess.PIPE, start_new_session=True
    )
    try:
        assert process.stdout.readline() == b"held\n"
        with pytest.raises(FolderInUseError, match=rf"\(pid {process.pid}\)"), sole_writer(tmp_path):
            pass
        process.kill()
        process.wait()
        os.killpg(process.pid, 0)  # its worker lives
        with sole_writer(tmp_path):
            pass
    finally:
        os.killpg(process.pid, signal.SIGKILL)


@pytest.mark.parametrize("command", [evaluate, train])
def test_two_roots_of_data_never_share_a_folder(command, smoke_config, smoke_root, other_root, tmp_path):
    """Of which the same clouds, moved elsewhere, are no second one."""

    def config(root):
        extra = TINY if command is train else ["data.limit=2"]
        return smoke_config(*extra, f"data.root={root}", f"train.folder={tmp_path / 'run'}")

    result, folder = command(config(smoke_root)), tmp_path / "run"
    message = rf"{folder} holds results for the data in {smoke_root} .*, not for {other_root}"
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    with pytest.raises(ValueError, match=message):
        command(config(other_root))
    assert {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == before
    for name in ("metrics.json", "training.json"):
        (folder / name).unlink(missing_ok=True)
    with pytest.raises(ValueError, match=message):  # nor before it has ended
        command(config(other_root))
    moved = shutil.copytree(smoke_root, tmp_path / "moved")
    assert command(config(moved))["data"] == result["data"]


def test_data_made_anew_starts_a_run_anew_but_lets_no_training_go_on(smoke_config, smoke_root, other_root, tmp_path):
    root = shutil.copytree(smoke_root, tmp_path / "root")
    limited = smoke_config("data.limit=2", f"data.root={root}")
    training = smoke_config(*TINY, f"data.root={root}", f"train.folder={tmp_path / 'training'}")
    first = evaluate(limited)
    train(training)
    (tmp_path / "training" / "training.json").unlink()
    shutil.rmtree(root)
    shutil.copytree(other_root, root)
    assert evaluate(limited)["data"]["manifest_sha256"] != first["data"]["manifest_sha256"]
    with pytest.raises(ValueError, match="holds results for the data in"):
        train(training)
