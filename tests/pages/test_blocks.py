"""What README and docs/ show under `<!-- run -->` runs as it stands there, a page's blocks one after the other."""

import csv
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from symshrec.cli import main
from tests.pages.reading import DOCS, README, ROOT, blocks

SHOWN = [README, *DOCS]


@pytest.fixture(scope="session")
def start(tmp_path_factory):
    """A folder with the smoke benchmark, which many pages begin with, and the command on a PATH."""
    folder = tmp_path_factory.mktemp("pages")
    program = folder / "bin" / "symshrec"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\nPYTHONPATH={ROOT}:$PYTHONPATH exec {sys.executable} -m symshrec "$@"\n')
    program.chmod(0o755)
    here = Path.cwd()
    os.chdir(folder)
    try:
        assert main(["generate", "data=smoke", "workers=1"]) == 0
    finally:
        os.chdir(here)
    return folder


def shell(line: str) -> None:
    """One line of a page: a command of ours in this process, which has imported it all, anything else in bash."""
    words = shlex.split(line)
    if words[0] == "export":
        name, _, value = words[1].partition("=")
        os.environ[name] = value
        sys.path.insert(0, str(Path(value).absolute()))
    elif words[0] == "symshrec" and "|" not in words and "*" not in line:
        assert main(words[1:]) == 0, line
    else:
        done = subprocess.run(["bash", "-eo", "pipefail", "-c", line], capture_output=True, text=True, check=False)
        assert done.returncode == 0, f"{line}\n{done.stderr}"


@pytest.mark.parametrize(
    "page", [page for page in SHOWN if any(each.runs for each in blocks(page))], ids=lambda page: page.stem
)
def test_blocks_run_as_they_stand(page, start, tmp_path, monkeypatch, capsys):
    folder = shutil.copytree(start, tmp_path / "here")
    monkeypatch.chdir(folder)
    monkeypatch.setattr(sys, "path", [*sys.path])
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    monkeypatch.setenv(
        "PATH", f"{folder / 'bin'}{os.pathsep}{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    )
    names: dict = {"__name__": "page"}
    for block in blocks(page):
        if not block.runs:
            continue
        if block.file:
            Path(block.file).write_text(block.text)
        elif block.language == "sh":
            for line in block.lines:
                shell(line)
        else:
            exec(compile(block.text, f"{page.name}: {block.text[:40]!r}", "exec"), names)
    printed = re.sub(r"\s+", " ", capsys.readouterr().out)
    if page == README:
        assert "chair.ply: 1 mirror plane (20,000 points, diagonal 1.29206" in printed
        assert "M3 (R1), 6 clouds, 1° and 1.00%: mAP" in printed


def test_pages_have_blocks_that_run():
    assert sum(each.runs for page in SHOWN for each in blocks(page)) >= 20


def test_the_readme_quotes_the_committed_table_and_is_short():
    with (ROOT / "results/paper/table2.csv").open() as file:
        rows = {(row["method"], row["metric"]): row for row in csv.DictReader(file) if row["group"] == "all"}
    quoted = re.findall(
        r"^\| (M\d(?: \(R\d\))?)[^|]* \|([^|]+)\|([^|]+)\|([^|]+)\|([^|]+)\|$", README.read_text(), re.M
    )
    assert len(quoted) == 8
    for method, *cells in quoted:
        published, ours = rows[method, "mAP"]["published"], rows[method, "mAP"]["ours"]
        others = [rows[method, metric]["ours"] for metric in ("recall_aware_mAP", "count_accuracy")]
        expected = [f"{float(value):.3f}" if value else "–" for value in (published, ours, *others)]
        assert [cell.strip() for cell in cells] == expected, f"README: {method} is {' | '.join(expected)}"
    assert len(README.read_text().split()) <= 900
