"""A benchmark made in parts by jobs that do not know each other: the same bytes, whatever their order and end."""

import os
import signal
import subprocess
import sys
import time

import pytest

from symshrec.benchmark.config import BenchmarkConfig, SplitConfig, SurfaceConfig
from symshrec.benchmark.generate import generate_dataset, generate_part
from symshrec.benchmark.manifest import ShardError, read_manifest
from symshrec.benchmark.shards import ShardedSplit
from symshrec.benchmark.tasks import Part, parse_part
from symshrec.cli import main
from symshrec.files.atomic import FolderInUseError, joint_writer, sole_writer

PROGRAM = """
import sys
from symshrec.benchmark.config import BenchmarkConfig, SplitConfig, SurfaceConfig
from symshrec.benchmark.generate import generate_part
from symshrec.benchmark.tasks import parse_part
generate_part(BenchmarkConfig(surface=SurfaceConfig(points=640, citrus_points=1280),
    splits={"train": SplitConfig(126), "test": SplitConfig(42)}, clouds_per_shard=7),
    sys.argv[1], parse_part(sys.argv[2]))
"""


def config():
    return BenchmarkConfig(
        surface=SurfaceConfig(points=640, citrus_points=1280),
        splits={"train": SplitConfig(126), "test": SplitConfig(42)},
        clouds_per_shard=7,
    )


def contents(root):
    return {path.name: path.read_bytes() for path in root.iterdir()}


def shards(root):
    return {path.name: path.stat().st_mtime_ns for path in root.glob("*.safetensors")}


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    root = tmp_path_factory.mktemp("whole")
    generate_dataset(config(), root, progress=False)
    return contents(root)


@pytest.mark.parametrize("order", [(1, 2, 3), (3, 1, 2)])
def test_parts_in_any_order_make_what_one_process_makes(order, whole, tmp_path):
    made = set()
    for number in order:
        before = shards(tmp_path)
        records = generate_part(config(), tmp_path, Part(number, 3), progress=False)
        assert len(records) == 8
        assert made.isdisjoint(each.file for each in records)
        made |= {each.file for each in records}
        assert before.items() <= shards(tmp_path).items()
        with pytest.raises(ShardError, match=r"manifest\.json is missing: generation is unfinished; .*without part"):
            ShardedSplit(tmp_path, "test")
    before = shards(tmp_path)
    assert generate_dataset(config(), tmp_path, progress=False) == read_manifest(tmp_path)
    assert contents(tmp_path) == whole
    assert shards(tmp_path) == before


def test_parts_at_once_one_of_them_killed_and_started_again(whole, tmp_path):
    def start(part):
        return subprocess.Popen([sys.executable, "-c", PROGRAM, tmp_path, part], start_new_session=True)

    killed, other = start("1/2"), start("2/2")
    deadline = time.monotonic() + 60
    while not list(tmp_path.glob("t*-*.json")):
        assert time.monotonic() < deadline
        time.sleep(0.005)
    os.kill(killed.pid, signal.SIGKILL)
    killed.wait()
    assert other.wait(timeout=60) == 0
    before = shards(tmp_path)
    (tmp_path / ".train-00000.safetensors.99.partial").write_bytes(b"half a shard")
    generate_part(config(), tmp_path, Part(1, 2), progress=False)
    assert before.items() <= shards(tmp_path).items()
    generate_dataset(config(), tmp_path, progress=False)
    assert contents(tmp_path) == whole


def test_the_last_call_makes_what_is_missing_or_damaged(whole, tmp_path):
    generate_part(config(), tmp_path, Part(2, 3), progress=False)
    path = min(tmp_path.glob("*.safetensors"))
    path.write_bytes(path.read_bytes()[:-1] + b"?")
    generate_dataset(config(), tmp_path, progress=False)
    assert contents(tmp_path) == whole
    path.unlink()
    generate_part(config(), tmp_path, Part(1, 3), progress=False)
    assert not path.exists()
    generate_part(config(), tmp_path, Part(2, 3), progress=False)
    assert contents(tmp_path) == whole


def test_shards_that_another_configuration_began_the_folder_with_are_not_taken(whole, tmp_path):
    """As where two jobs wrote their requests at once and neither saw the other's."""
    other = config()
    other.seed = 7
    generate_part(other, tmp_path, Part(1, 2), progress=False)
    with pytest.raises(ShardError, match="seed: folder has 7, asked for 2023"):
        generate_part(config(), tmp_path, Part(2, 2), progress=False)
    (tmp_path / "request.json").unlink()
    generate_part(config(), tmp_path, Part(2, 2), progress=False)
    generate_dataset(config(), tmp_path, progress=False)
    assert contents(tmp_path) == whole


def test_more_parts_than_shards_leave_some_without_work(tmp_path):
    assert generate_part(config(), tmp_path, Part(25, 25), progress=False) == []
    assert generate_part(config(), tmp_path, Part(24, 25), progress=False)[0].file == "test-00005.safetensors"


def test_parts_share_a_folder_and_the_last_call_has_it_alone(tmp_path):
    with joint_writer(tmp_path):
        assert len(generate_part(config(), tmp_path, Part(24, 24), progress=False)) == 1
        with pytest.raises(FolderInUseError, match="another process"):
            generate_dataset(config(), tmp_path, progress=False)
    with sole_writer(tmp_path), pytest.raises(FolderInUseError, match="another process"):
        generate_part(config(), tmp_path, Part(1, 24), progress=False)


@pytest.mark.parametrize("text", ["0/4", "5/4", "x/y", "1/0", "2", "-1/4", "1/4/2", "1 /4", "²/4", ""])
def test_a_part_that_there_is_not(text):
    with pytest.raises(ValueError, match=r"it must be K/N with K from 1 to N, such as 2/8, or all$"):
        parse_part(text)


def test_on_the_command_line(small_benchmark, tmp_path, capsys):
    words = [*small_benchmark, f"data.root={tmp_path / 'out'}", "workers=1"]
    with pytest.raises(SystemExit) as end:
        main(["generate", *words, "part=5/4"])
    assert end.value.code == 2
    assert capsys.readouterr().err == (
        "symshrec generate: part is 5/4; it must be K/N with K from 1 to N, such as 2/8, or all\n"
    )
    assert not (tmp_path / "out").exists()
    assert main(["generate", *words, "part=1/2"]) == 0
    assert "part 1 of 2: 5 shards, 42 clouds; when all parts have ended" in capsys.readouterr().out
    assert main(["generate", *words]) == 0
    assert "42 train, 42 test clouds" in capsys.readouterr().out
