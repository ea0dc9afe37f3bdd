"""The import rules of the house, and what an install brings."""

import os
import re
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

import symshrec

ROOT = Path(__file__).parents[1]


def test_the_import_contracts_hold_and_were_checked():
    command = [Path(sys.executable).with_name("lint-imports"), "--config", ROOT / "pyproject.toml", "--no-cache"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    assert {"layers", "forbidden"} == {contract["type"] for contract in contracts}
    assert re.findall(r"^(.+) KEPT$", done.stdout, re.MULTILINE) == [contract["name"] for contract in contracts]
    (files,) = re.findall(r"^Analyzed ([\d,]+) files", done.stdout, re.MULTILINE)
    assert int(files.replace(",", "")) > 100


def test_every_room_has_its_place_in_the_order_of_imports():
    linter = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]
    (layers,) = [contract["layers"] for contract in linter["contracts"] if contract["type"] == "layers"]
    ordered = {name.strip() for layer in layers for name in re.split("[:|]", layer)}
    assert ordered == {f"symshrec.{path.stem}" for path in rooms()}


def test_the_hall_stays_small():
    assert 1 < len(rooms()) <= 13


def rooms() -> list[Path]:
    """What lies at the top of the package, but for what every package has there."""
    usual = {"__init__.py", "__main__.py", "py.typed", "__pycache__"}
    return [path for path in (ROOT / "symshrec").iterdir() if path.name not in usual]


def test_the_version_moves_everywhere_at_once():
    assert f"\nversion: {symshrec.__version__}\n" in (ROOT / "CITATION.cff").read_text()
    assert f"\n## [{symshrec.__version__}]" in (ROOT / "CHANGELOG.md").read_text()


def test_an_editable_install_leaves_a_path_and_its_metadata_alone(tmp_path):
    program = f"import hatchling.build; print(hatchling.build.build_editable({str(tmp_path)!r}))"
    subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, check=True)
    (wheel,) = tmp_path.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        installed = [name for name in archive.namelist() if ".dist-info/" not in name]
        assert len(installed) == 1
        assert installed[0].endswith(".pth")
        assert archive.read(installed[0]).decode().strip() == str(ROOT)


def test_a_wheel_brings_its_configuration_and_the_published_tables(tmp_path):
    build = [sys.executable, "-m", "hatchling", "build", "--target", "wheel", "--directory", tmp_path]
    subprocess.run(build, cwd=ROOT, capture_output=True, check=True)
    (wheel,) = tmp_path.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(tmp_path / "site")
    program = (
        "import symshrec.runs.config as c, symshrec.reporting.tables.published as p\n"
        "print(c.conf_folder(), c.load(['run=m3_r2']).method.neighbours, len(p.published_cells()))"
    )
    environment = {**os.environ, "PYTHONPATH": str(tmp_path / "site")}
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.split() == [str(tmp_path / "site" / "symshrec" / "conf"), "250", "196"]


@pytest.mark.parametrize("script", sorted(ROOT.glob("experiments/*.py")), ids=lambda path: path.stem)
def test_every_script_of_this_repository_can_be_imported(script):
    command = [sys.executable, script, "--help"]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
