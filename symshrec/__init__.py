"""Reflection symmetries of 3D point clouds: the SHREC 2023 track, generated, scored, reproduced and beaten."""

from importlib import import_module

__version__ = "0.2.0"
_API = ("TensorPlanes", "detect", "evaluate", "train")
_PLANES = ("Planes", "PointGroup", "point_group")
_MEASURES = ("asymmetry", "mirror_correspondences", "mirror_deviations", "mirror_residuals")
_HOMES = {
    **dict.fromkeys(_PLANES, "planes"),
    **dict.fromkeys(_MEASURES, "geometry.residuals"),
    **dict.fromkeys(_API, "api"),
}  # imported when first asked for

__all__ = [
    "Planes",
    "PointGroup",
    "TensorPlanes",
    "__version__",
    "asymmetry",
    "detect",
    "evaluate",
    "mirror_correspondences",
    "mirror_deviations",
    "mirror_residuals",
    "point_group",
    "train",
]


def __getattr__(name: str):
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOMES})
