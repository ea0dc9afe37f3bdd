"""The recipe for a method of one's own, of docs/own-method.md, as a package with an entry point."""

import json
import os
import re
import subprocess
import sys

import numpy as np

from tests.pages.reading import ROOT, blocks


def test_the_recipe_runs_by_its_class_and_by_its_entry_point(tmp_path, smoke_root, small_benchmark):
    shown = blocks(ROOT / "docs" / "own-method.md")
    (module,), (entry_point,) = ([each.text for each in shown if each.language == name] for name in ("python", "toml"))
    (tmp_path / "my_package.py").write_text(module)
    about = tmp_path / "my_package-1.dist-info"  # as an installation leaves it
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: my-package\nVersion: 1\n")
    group, line = re.search(r'entry-points\."(.+)"\]\n(.+)\n', entry_point).groups()
    (about / "entry_points.txt").write_text(f"[{group}]\n{line.replace(chr(34), '')}\n")
    environment = os.environ | {"PYTHONPATH": f"{ROOT}{os.pathsep}{tmp_path}"}

    def symshrec(*words: str) -> str:
        command = [sys.executable, "-m", "symshrec", *words]
        return subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True).stdout

    overrides = [*small_benchmark, f"data.root={smoke_root}", "data.limit=4", "logger=none", "callbacks=none"]
    for name in ("my_package.AxisPlanes", "axes"):
        symshrec("evaluate", f"method={name}", "method.confidence=0.9", "folder=run_" + name, *overrides)
        result = json.loads((tmp_path / f"run_{name}" / "metrics.json").read_text())
        assert (result["name"], result["method"], result["data"]["clouds"]) == (name, name, 4)
    np.savetxt(tmp_path / "scan.xyz", np.random.default_rng(0).normal(size=(50, 3)))
    assert "3 mirror planes" in symshrec("detect", "scan.xyz", "--method", "axes", "--set", "confidence=0.9")
