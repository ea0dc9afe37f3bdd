"""Reflection symmetries of 3D point clouds: the SHREC 2023 track, generated, scored, reproduced and beaten."""

from importlib import import_module

__version__ = "0.2.0"
_API = ("TensorPlanes", "detect", "evaluate", "train")
_HOMES = {"Planes": "planes", **dict.fromkeys(_API, "api")}  # imported when first asked for

__all__ = ["Planes", "TensorPlanes", "__version__", "detect", "evaluate", "train"]


def __getattr__(name: str):
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOMES})
