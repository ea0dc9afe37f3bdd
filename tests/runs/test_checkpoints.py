"""Checkpoints under flips, cuts and kills: damage is named, and the newest sound one is taken."""

import logging
import os

import numpy as np
import pytest
import torch

from symshrec.runs import checkpoints
from symshrec.runs.checkpoints import CheckpointError, VerifiedCheckpoints, begun, copy_newest, settle, steps_done


def content(step):
    generator = torch.Generator().manual_seed(step)
    return {"global_step": step, "state_dict": {"weight": torch.randn(7, 5, generator=generator)}, "loops": {"a": [1]}}


def plain(checkpoint):
    return {**checkpoint, "state_dict": {name: each.tolist() for name, each in checkpoint["state_dict"].items()}}


def same(one, other):
    return plain(one) == plain(other)


@pytest.fixture
def files():
    return VerifiedCheckpoints()


@pytest.fixture
def last(tmp_path, files):
    """The path of step 2's checkpoint, step 1's beside it."""
    for step in (1, 2):
        files.save_checkpoint(content(step), tmp_path / "last.ckpt")
    return tmp_path / "last.ckpt"


def damages(data):
    rng = np.random.default_rng(0)
    for place in rng.integers(len(data), size=60):
        flipped = bytearray(data)
        flipped[place] ^= 1 << int(rng.integers(8))
        yield bytes(flipped)
    for length in (0, 1, 21, len(data) // 2, len(data) - 81, len(data) - 80, len(data) - 64, len(data) - 1):
        yield data[:length]
    yield data + b"\0"
    yield bytes(len(data))


def test_what_was_saved_is_read_here_and_by_pytorch_alone(last, files):
    assert same(files.load_checkpoint(last), content(2))
    for mmap in (False, True):
        assert same(torch.load(last, weights_only=True, mmap=mmap), content(2))
    assert same(torch.load(last.with_name("previous.ckpt"), weights_only=True), content(1))
    assert {path.name for path in last.parent.iterdir()} == {"last.ckpt", "previous.ckpt"}


def test_every_damage_is_named_and_the_previous_checkpoint_taken(last, files, caplog):
    for data in damages(last.read_bytes()):
        last.write_bytes(data)
        caplog.clear()
        assert same(files.load_checkpoint(last), content(1))
        assert f"{last} is damaged: " in caplog.text
        assert "going on from previous.ckpt, step 1" in caplog.text


def test_of_a_checkpoint_without_checksum_a_flip_is_found_or_changes_nothing(last, files):
    last.with_name("previous.ckpt").unlink()
    torch.save(content(5), last)
    assert same(files.load_checkpoint(last), content(5))
    found = 0
    for data in damages(last.read_bytes()):
        last.write_bytes(data)
        try:
            assert same(files.load_checkpoint(last), content(5))
        except CheckpointError:
            found += 1
    assert found > 15


def test_without_a_sound_one_the_error_says_what_to_do(last, files):
    last.write_bytes(last.read_bytes()[:-1])
    last.with_name("previous.ckpt").write_bytes(b"")
    with pytest.raises(CheckpointError, match=r"last\.ckpt is damaged: .*previous\.ckpt .*Put back a copy") as error:
        files.load_checkpoint(last)
    assert "\n" not in str(error.value)
    with pytest.raises(CheckpointError, match="holds no checkpoint"):
        steps_done(last.parent / "nowhere")


class Kill(BaseException):
    pass


@pytest.mark.parametrize("moment", range(4))
def test_a_kill_between_any_two_steps_of_a_save_leaves_the_newest_sound_one(last, files, moment, monkeypatch):
    """Before the new file is whole, before it is verified, before the former gives way, before it takes its place."""
    names, seen = ["replace", "damage", "replace", "replace"], []

    def killed(name, function):
        def step(*arguments):
            if [*seen, name] == names[: moment + 1]:
                raise Kill
            seen.append(name)
            if name == "damage" and seen.count(name) == 2:  # of the former one: the disk is not changed
                seen.pop()
            return function(*arguments)

        return step

    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", killed("replace", os.replace))
        patch.setattr(checkpoints, "damage", killed("damage", checkpoints.damage))
        with pytest.raises(Kill):
            files.save_checkpoint(content(3), last)
    newest = 2 if moment == 0 else 3
    assert begun(last.parent)
    assert steps_done(last.parent) == newest
    assert same(files.load_checkpoint(last), content(newest))
    settle(last.parent)
    assert same(torch.load(last, weights_only=True), content(newest))
    files.save_checkpoint(content(4), last)
    assert [steps_done(last.parent), torch.load(last.with_name("previous.ckpt"))["global_step"]] == [4, newest]


def test_a_damaged_last_checkpoint_never_takes_the_place_of_the_previous_one(last, files):
    last.write_bytes(b"damaged")
    files.save_checkpoint(content(3), last)
    last.write_bytes(b"damaged again")
    assert steps_done(last.parent) == 1


def test_a_disk_that_gives_back_something_else_is_found_out(last, files, monkeypatch):
    monkeypatch.setattr(checkpoints, "write_atomically", lambda path, data: path.write_bytes(data[:-1]))
    with pytest.raises(OSError, match=r"last\.ckpt: what was just written is damaged"):
        files.save_checkpoint(content(3), last)
    assert steps_done(last.parent) == 2


def test_nothing_untrusted_is_unpickled(last, files):
    class Evil:
        def __reduce__(self):
            return os.mkdir, (str(last.parent / "opened"),)

    files.save_checkpoint({"global_step": 3, "evil": Evil()}, last)
    assert same(files.load_checkpoint(last, weights_only=False), content(2))
    assert not (last.parent / "opened").exists()


def test_a_copy_is_of_the_newest_sound_one(last, files, tmp_path, caplog):
    last.write_bytes(b"damaged")
    (tmp_path / "branch").mkdir()
    with caplog.at_level(logging.WARNING):
        copy_newest(last.parent, tmp_path / "branch")
    assert "last.ckpt is damaged" in caplog.text
    assert steps_done(tmp_path / "branch") == 1


def test_other_files_of_lightning_are_single_and_sealed(tmp_path, files):
    for step in (1, 2):
        files.save_checkpoint(content(step), tmp_path / "best.ckpt")
    assert [path.name for path in tmp_path.iterdir()] == ["best.ckpt"]
    data = bytearray((tmp_path / "best.ckpt").read_bytes())
    data[100] ^= 1
    (tmp_path / "best.ckpt").write_bytes(data)
    with pytest.raises(CheckpointError, match=r"best\.ckpt is damaged: its bytes do not match its sha256"):
        files.load_checkpoint(tmp_path / "best.ckpt")
    files.remove_checkpoint(tmp_path / "best.ckpt")
    assert not list(tmp_path.iterdir())
