"""Which methods there are: ours, those of installed packages, and any class by its dotted name.

A package registers its method with an entry point, and edits nothing here:

    [project.entry-points."symshrec.methods"]
    centroid = "my_package:CentroidPlanes"

The class derives from `SymmetryMethod`, takes one instance of its `Settings` (a frozen dataclass derived from
`MethodSettings`), and states a `version`, raised whenever its planes change.
"""

import re
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from typing import TYPE_CHECKING

from symshrec.methods.settings import MethodSettings

if TYPE_CHECKING:
    from symshrec.methods.base import SymmetryMethod  # Lightning, which takes seconds to import

GROUP = "symshrec.methods"
DOTTED = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)+")


@dataclass(frozen=True)
class BuiltIn:
    """A method of ours: where its settings and its class are, and its `detect_planes` where that needs no Lightning."""

    settings: str
    method: str
    pipeline: str | None = None


BUILT_IN = {
    "m1": BuiltIn("m1.settings:M1Settings", "m1.module:M1"),
    "m2": BuiltIn("m2.settings:M2Settings", "m2.module:M2"),
    "m2_pretrain": BuiltIn("m2.settings:M2Settings", "m2.pretraining:M2Pretraining"),
    "m3": BuiltIn("m3.settings:M3Settings", "m3.module:M3", "m3.pipeline:detect_planes"),
    "m4": BuiltIn("m4.settings:M4Settings", "m4.module:M4", "m4.pipeline:detect_planes"),
    "pca_icp": BuiltIn(
        "baselines.settings:PcaIcpSettings", "baselines.module:PcaIcp", "baselines.pca_icp:detect_planes"
    ),
    "ransac": BuiltIn("baselines.settings:RansacSettings", "baselines.module:Ransac", "baselines.ransac:detect_planes"),
    "oracle": BuiltIn("oracle.settings:OracleSettings", "oracle.module:Oracle"),
}


def method_names() -> list[str]:
    """Names of all methods that can be chosen, ours first; those of other packages by their entry points."""
    return list(dict.fromkeys([*BUILT_IN, *sorted(_entry_points())]))


def check_method_name(name: str) -> None:
    """Refuse what names no method.

    Raises:
        ValueError: naming those that there are.
    """
    if name not in method_names() and not DOTTED.fullmatch(name):
        raise ValueError(f"there is no method {name!r}; there is {', '.join(method_names())}, or my.module.Class")


def settings_class(name: str) -> type[MethodSettings]:
    """The settings of the method of this name; Lightning is imported only for methods of other packages.

    Raises:
        ValueError: as `method_class`.
    """
    if name in BUILT_IN:
        return _ours(BUILT_IN[name].settings)
    return method_class(name).Settings


def method_class(name: str) -> type["SymmetryMethod"]:
    """The class of the method of this name: ours, an entry point's, or at a dotted path such as my.module.Class.

    Raises:
        ValueError: where there is none, it cannot be imported, or is no method; says what can be chosen or done.
    """
    if name in BUILT_IN:
        return _ours(BUILT_IN[name].method)
    check_method_name(name)
    found = _entry_points().get(name)
    chosen = _imported(name) if found is None else _loaded(found)
    from symshrec.methods.base import SymmetryMethod

    if not (isinstance(chosen, type) and issubclass(chosen, SymmetryMethod)):
        raise ValueError(f"method {name}: {chosen!r} is no class derived from symshrec.methods.SymmetryMethod")
    if not (isinstance(chosen.Settings, type) and issubclass(chosen.Settings, MethodSettings)):
        raise ValueError(f"method {name}: its Settings must be derived from symshrec.methods.MethodSettings")
    return chosen


def detect_planes_of(name: str):
    """`detect_planes(points, settings)` of a method that needs no Lightning; None for the others."""
    place = BUILT_IN[name].pipeline if name in BUILT_IN else None
    return None if place is None else _ours(place)


def _ours(place: str):
    module, _, attribute = place.partition(":")
    return getattr(import_module(f"symshrec.methods.{module}"), attribute)


def _entry_points() -> dict[str, EntryPoint]:
    return {each.name: each for each in entry_points(group=GROUP)}


def _loaded(found: EntryPoint):
    try:
        return found.load()
    except Exception as error:  # whatever another package's import may raise
        raise ValueError(
            f"method {found.name}: its entry point {found.value} cannot be loaded ({type(error).__name__}: {error})"
        ) from error


def _imported(path: str):
    module, _, attribute = path.rpartition(".")
    try:
        return getattr(import_module(module), attribute)
    except (ImportError, AttributeError) as error:
        raise ValueError(
            f"method {path} cannot be imported ({error}); is its module on PYTHONPATH, or its package installed?"
        ) from error
