"""Every command, option, setting, link and anchor that README and docs/ name is there."""

import re
import shlex
import tomllib
from functools import cache
from importlib import import_module

import pytest

from symshrec.cli import COMMANDS, OWN
from symshrec.runs.config import load
from tests.pages.reading import PAGES, README, ROOT, anchors, blocks, links, spans

MAKEFILE = (ROOT / "Makefile").read_text()
EXTRAS = set(tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"])
SETTING = re.compile(r"\+?[a-z][\w./]*=\S+")
PLACEHOLDER = re.compile(r"=\[?(file://)?[A-Z]+\]?$|=$|…")
METHODS = ("m3", "m1", "m2", "m4", "oracle", "ransac")  # whose settings pages name by themselves
FREE = {".", "export", "ls", "head", "tensorboard", "zcat", "cp", "apt-get"}  # programs of others


@pytest.fixture(autouse=True)
def own_method(tmp_path, monkeypatch):
    """The method that pages bring along, importable."""
    (module,) = [each.text for each in blocks(ROOT / "docs" / "own-method.md") if each.language == "python"]
    (tmp_path / "my_package.py").write_text(module)
    for block in blocks(README):
        if block.file:
            (tmp_path / block.file).write_text(block.text)
    monkeypatch.syspath_prepend(tmp_path)


def check(line: str) -> None:
    """Hold one command against what there is; a pipe's parts one by one."""
    for part in line.split(" | "):
        program, *words = shlex.split(part)
        if program == "symshrec":
            check_ours(words)
        elif program == "make":
            for word in words:
                name, value, _ = word.partition("=")
                assert re.search(rf"^{name} \?=" if value else rf"^{name}:", MAKEFILE, re.M), f"{line}: no {name}"
        elif program.startswith("experiments/") or (words[:1] and words[0].startswith("experiments/")):
            assert (ROOT / (program if program != "python" else words[0])).is_file(), line
        elif program == "python":
            assert words[0] in ("-m", "-c")
            assert words[0] == "-c" or (ROOT / words[1].replace(".", "/")).with_suffix(".py").is_file(), line
        elif program == "pip":
            extras = re.findall(r"symshrec\[(\w+)\]", part)
            assert extras
            assert set(extras) <= EXTRAS, line
        else:
            assert program in FREE, f"{line}: what is {program}?"


def check_ours(words: list[str]) -> None:
    """A command's name, its options, or its settings."""
    if not words or words[0].startswith("-"):
        assert set(words) <= {"--version", "--help"}, words
        return
    command, *rest = words
    assert command in COMMANDS, f"there is no command {command}"
    rest = [word for word in rest if not PLACEHOLDER.search(word)]
    if command in OWN:
        known = {
            option
            for action in import_module(f"symshrec.cli.{command}").parser()._actions
            for option in action.option_strings
        }
        wrong = [word for word in rest if word.startswith("-") and word not in ("-", *known)]
        assert not wrong, f"symshrec {command} has no {wrong[0]}"
    else:
        options = {word for word in rest if word.startswith("--")}
        assert options <= {"--multirun", "--help", "--config-dir"}, options
        compose(tuple(word for word in rest if word not in (*options, "FOLDER")))


@cache
def compose(words: tuple[str, ...]) -> None:
    """Compose settings; of a sweep over several values the first, of a launcher's nothing."""
    chosen = [re.sub(r"^([\w./]+=[^,\[{(]+),.*", r"\1", word) for word in words]
    load([word for word in chosen if not word.startswith(("hydra", "fingerprint=glob"))])


def check_settings(words: list[str]) -> None:
    """Hold settings that a page names by themselves against those of some method."""
    for method in METHODS:
        try:
            own = [] if words[0].startswith(("method=", "experiment=")) else [f"method={method}"]
            return compose((*own, *words))
        except ValueError as error:
            wrong = error
    raise wrong


@pytest.mark.parametrize("page", PAGES, ids=lambda page: f"{page.parent.name}/{page.stem}")
def test_commands_options_and_settings_are_there(page):
    for block in blocks(page):
        for line in block.lines if block.language == "sh" else ():
            check(line)
    for span in spans(page):
        first = span.split()[0] if span.split() else ""
        ours = first in ("symshrec", "make", "pip") and " " in span
        if ours or re.match(r"(python )?experiments/\w+\.", span):
            check(span)
        elif all(map(SETTING.fullmatch, span.split())) and not PLACEHOLDER.search(span):
            check_settings(span.split())


@pytest.mark.parametrize(
    "line",
    [
        "symshrec detect --nonsense",
        "symshrec evaluate data=nonsense",
        "symshrec nonsense x",
        "make nonsense",
        "nonsense",
    ],
)
def test_what_is_not_there_is_noticed(line):
    with pytest.raises((AssertionError, ValueError)):
        check(line)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: f"{page.parent.name}/{page.stem}")
def test_links_pictures_and_anchors_resolve(page):
    for link in links(page):
        path, _, anchor = link.partition("#")
        if "://" in path:
            continue
        target = (page.parent / path).resolve() if path else page
        assert target.exists(), f"{page.name}: {link}"
        if anchor.startswith("symshrec."):
            named = re.findall(r"^::: (\S+)", target.read_text(), re.M)
            assert any(anchor == each or anchor.startswith(f"{each}.") for each in named), f"{page.name}: {link}"
            module, _, name = anchor.rpartition(".")
            assert hasattr(import_module(module), name), f"{page.name}: {link}"
        elif anchor:
            assert anchor in anchors(target), f"{page.name}: {link}"
