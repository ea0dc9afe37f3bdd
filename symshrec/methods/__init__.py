"""The methods of section 3 and ours, and what a method of your own derives from."""

from importlib import import_module

DEFAULT = "m4"  # for people's own clouds
_HOMES = {  # imported when first asked for: Lightning takes seconds
    "LearnedMethod": "learned",
    "LearnedSettings": "settings",
    "MethodSettings": "settings",
    "SymmetryMethod": "base",
}

__all__ = ["DEFAULT", "LearnedMethod", "LearnedSettings", "MethodSettings", "SymmetryMethod"]


def __getattr__(name: str):
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
