"""Every public function of planes, geometry and metrics shows what it does, and does what it shows."""

import doctest
import importlib
import inspect
import pkgutil

import pytest

import symshrec.geometry
import symshrec.metrics
import symshrec.planes

MODULES = [
    f"{package.__name__}.{each.name}"
    for package in (symshrec.planes, symshrec.geometry, symshrec.metrics)
    for each in pkgutil.iter_modules(package.__path__)
]
CLASSES = {
    "Planes",
    "PackedPlanes",
    "UnitSphere",
    "DiscSurface",
    "SymmetryMetric",
}  # the others are what functions give back


@pytest.mark.parametrize("name", MODULES)
def test_examples_hold_and_none_is_missing(name):
    module = importlib.import_module(name)
    shown = {
        test.name.removeprefix(f"{name}.")
        for test in doctest.DocTestFinder(exclude_empty=True).find(module)
        if test.examples
    }
    public = {
        each.__name__
        for each in vars(module).values()
        if getattr(each, "__module__", None) == name
        and (inspect.isfunction(each) or each.__name__ in CLASSES)
        and not each.__name__.startswith("_")
    }
    assert public, f"{name} has nothing public; take it out of this test"
    assert not public - shown, f"without an example in their docstrings: {sorted(public - shown)}"
    result = doctest.testmod(module)
    assert result.attempted
    assert not result.failed, "see the failed examples above"
