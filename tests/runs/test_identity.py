"""What decides a stored run counts, and nothing else."""

import importlib
import shutil
import sys
from dataclasses import dataclass, field

import numpy as np
import pytest

from symshrec.methods.fit import REFINEMENT_VERSION
from symshrec.methods.m1.module import M1
from symshrec.methods.m3.module import M3
from symshrec.methods.m3.settings import M3Settings
from symshrec.methods.m4.module import M4
from symshrec.methods.oracle.module import Oracle
from symshrec.methods.settings import HARMLESS, MethodSettings
from symshrec.methods.weights import shipped, weights_folder
from symshrec.runs.config import load, method_of
from symshrec.runs.identity import decisive_settings, differences, digest, method_identity, run_identity, unrefined

PACKAGE = {
    "__init__.py": "",
    "method.py": """
from symshrec.methods.base import SymmetryMethod
from symshrec.methods.m3.module import M3
from symshrec.methods.m3.settings import M3Settings
from .parts import half
import theirs.more.deep

class Mine(SymmetryMethod):
    def detect(self, points):
        return half(points)

class Stated(Mine):
    name, version = "stated", 3

class OnM3(M3):
    pass
""",
    "parts.py": "def half(points):\n    return points[: len(points) // 2]\n",
    "more/__init__.py": "",
    "more/deep.py": "DEPTH = 1\n",
    "unrelated.py": "X = 1\n",
}
CLOUDS = {"data": "d" * 64, "positions": np.arange(5), "sampling": {"kind": "none"}, "seed": 1, "precision": "32-true"}


def identity(method, **changed):
    return run_identity(method, **{**CLOUDS, "refinement": REFINEMENT_VERSION, **changed})


@pytest.fixture
def theirs(tmp_path, monkeypatch):
    """A package from outside: its module, and a function that writes one of its files anew."""
    for name, text in PACKAGE.items():
        path = tmp_path / "theirs" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    importlib.invalidate_caches()
    yield importlib.import_module("theirs.method"), lambda name, text: (tmp_path / "theirs" / name).write_text(text)
    for name in [name for name in sys.modules if name.partition(".")[0] == "theirs"]:
        del sys.modules[name]


@pytest.mark.parametrize(("kind", "name"), [(M3, "m3"), (M4, "m4"), (Oracle, "oracle"), (M1, "m1")])
def test_a_method_of_the_package_is_known_by_its_name_and_version(kind, name, monkeypatch):
    for version in (1, 2):
        monkeypatch.setattr(kind, "version", version)
        assert method_identity(kind()) == {name: version}


def test_a_method_from_outside_is_known_by_its_source(theirs):
    module, write = theirs
    before = method_identity(module.Mine())
    write("parts.py", f"# a comment\n\n{PACKAGE['parts.py']}  # costs nothing\n")
    write("unrelated.py", "X = 2\n")
    assert method_identity(module.Mine()) == before
    for name, text in (
        ("parts.py", "def half(points):\n    return points[: len(points) // 3]\n"),
        ("more/deep.py", ""),
    ):
        write(name, text)
        after = method_identity(module.Mine())
        assert after != before
        before = after


def test_a_version_counts_for_the_class_that_states_it_alone(theirs):
    module, write = theirs
    stated, mine = (method_identity(kind()) for kind in (module.Stated, module.Mine))
    assert stated == {"stated": 3, **mine}
    on_m3 = method_identity(module.OnM3())
    assert on_m3["m3"] == 1
    write("method.py", PACKAGE["method.py"].replace("    pass", "    def detect(self, points):\n        return None"))
    assert method_identity(module.OnM3()) != on_m3


def test_modules_beside_a_loose_one_count_too(tmp_path, monkeypatch):
    (tmp_path / "loose.py").write_text(
        "import beside\nfrom symshrec.methods.base import SymmetryMethod\n\n"
        "class Loose(SymmetryMethod):\n    def detect(self, points):\n        return beside.X\n"
    )
    (tmp_path / "beside.py").write_text("X = 1\n")
    monkeypatch.syspath_prepend(tmp_path)
    loose = importlib.import_module("loose")
    before = method_identity(loose.Loose())
    (tmp_path / "beside.py").write_text("X = 2\n")
    assert method_identity(loose.Loose()) != before
    (tmp_path / "loose.py").unlink()
    with pytest.raises(ValueError, match=r"loose\.Loose cannot be read .*state `version = 1` in the class"):
        method_identity(loose.Loose())
    for name in ("loose", "beside"):
        del sys.modules[name]


def test_harmless_settings_do_not_count():
    @dataclass(frozen=True)
    class Part:
        depth: int = 2
        shown: int = field(default=3, metadata=HARMLESS)

    @dataclass(frozen=True)
    class Settings(MethodSettings):
        width: float = 1.5
        colour: str = field(default="red", metadata=HARMLESS)
        part: Part = field(default_factory=Part)

    assert decisive_settings(Settings(workers=3, name="mine")) == {"width": 1.5, "part": {"depth": 2}}


@pytest.mark.parametrize("change", ["method.workers=3", "method.count_threshold=.1", "method.weights=[COPY]"])
def test_what_decides_nothing_of_the_planes_changes_nothing(change, tmp_path):
    def of(*overrides):
        config = load(["method=m1", f"method.weights=[{shipped('m1')[0]}]", *overrides])
        return identity(method_of(config))

    copy = shutil.copy(weights_folder() / f"{shipped('m1')[0]}.safetensors", tmp_path / "copy.safetensors")
    assert digest(of(change.replace("COPY", str(copy)))) == digest(of())
    assert digest(of("method.twice=true")) != digest(of())


def test_everything_that_decides_the_planes_changes_the_digest_and_is_named():
    base = identity(M3())
    assert digest(dict(reversed(base.items()))) == digest(base)
    changes = {
        "method.neighbours: 200 → 250": identity(M3(M3Settings(neighbours=250))),
        f"data.sha256: {'d' * 12}… → {'e' * 12}…": identity(M3(), data="e" * 64),
        "seed: 1 → 2": identity(M3(), seed=2),
        "sampling.kind: none → random": identity(M3(), sampling={"kind": "random"}),
        "precision: 32-true → bf16-mixed": identity(M3(), precision="bf16-mixed"),
        f"refinement: none → {REFINEMENT_VERSION}": identity(M3(M3Settings(refine=True))),
    }
    for phrase, other in changes.items():
        assert differences(base, other) == [phrase]
        assert digest(other) != digest(base)
    assert [each.partition(":")[0] for each in differences(base, identity(M3(), positions=np.arange(6)))] == [
        "data.positions"
    ]
    assert unrefined(identity(M3(M3Settings(refine=True)), refinement=7)) == base == identity(M3(), refinement=7)


def test_a_setting_that_names_a_file_counts_by_its_content(tmp_path):
    @dataclass(frozen=True)
    class Settings(MethodSettings):
        table: str = ""

    path = tmp_path / "table.csv"
    path.write_bytes(b"1")
    before = decisive_settings(Settings(table=str(path)))
    path.write_bytes(b"2")
    assert decisive_settings(Settings(table=str(path))) != before
