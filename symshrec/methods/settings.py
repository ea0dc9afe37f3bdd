"""What every method's settings have. No torch here: the schema of conf/ is made of these."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from enum import Enum
from typing import Any, TypeVar

Kind = TypeVar("Kind")
HARMLESS = {"harmless": True}  # metadata of a field that decides nothing of the planes


@dataclass(frozen=True)
class MethodSettings:
    """The base of a method's settings: derive from it, and add the method's own as fields with defaults.

    A method's settings stand here once: they are its schema in conf/, its defaults and its only constructor argument.
    Fields may be numbers, strings, Enums, tuples and further frozen dataclasses. One that changes no plane is marked
    `field(default=…, metadata=HARMLESS)`; stored runs outlive its changes.

    Args:
        name: under which the registry knows the method.
        count_threshold: planes of at least this confidence count as found in the count accuracy.
        workers: processes for what is done cloud by cloud on the CPU; 0 and 1 work in this one.
        refine: whether refinement follows detection.

    Raises:
        ValueError: naming the field that is out of its range.
    """

    name: str = field(default="", metadata=HARMLESS)
    count_threshold: float = field(default=0.5, metadata=HARMLESS)
    workers: int = field(default=0, metadata=HARMLESS)
    refine: bool = False

    def __post_init__(self):
        if self.workers < 0:
            raise ValueError(f"workers is {self.workers}, expected 0 or more")


@dataclass(frozen=True)
class LearnedSettings(MethodSettings):
    """The base of the settings of a method with weights.

    Args:
        weights: names of shipped ones or .safetensors files, trainings of the same network that answer together; none
            leaves a network that must be trained first. Their content decides the planes, not their names.
    """

    weights: tuple[str, ...] = field(default=(), metadata=HARMLESS)

    def __post_init__(self):
        super().__post_init__()
        object.__setattr__(self, "weights", tuple(self.weights))


def plain_settings(settings) -> dict[str, Any]:
    """Settings as what JSON holds: nested dicts, enums by name, tuples as lists."""
    return {each.name: _plain(getattr(settings, each.name)) for each in fields(settings)}


def decisive_settings(settings) -> dict[str, Any]:
    """Likewise, without the fields that decide nothing of the planes."""
    decisive = (each for each in fields(settings) if not each.metadata.get("harmless"))
    return {each.name: _plain(getattr(settings, each.name)) for each in decisive}


def restored_settings(kind: type[Kind], plain: Mapping[str, Any]) -> Kind:
    """Settings of a kind, made of scalars, Enums and tuples, from what `plain_settings` gave.

    Raises:
        ValueError: naming a field that the kind does not have, or a value out of its range.
    """
    known = {each.name: each.type for each in fields(kind)}
    if unknown := sorted(set(plain) - set(known)):
        raise ValueError(f"{kind.__name__} has no field {unknown[0]!r}; it has {', '.join(known)}")
    values = {}
    for name, value in plain.items():
        is_enum = isinstance(known[name], type) and issubclass(known[name], Enum)
        if is_enum and value not in known[name].__members__:
            raise ValueError(f"{name} is {value!r}; choose from {', '.join(known[name].__members__)}")
        values[name] = known[name][value] if is_enum else value
    return kind(**values)


def check_ranges(settings, ranges: Mapping[str, tuple[float, float]], prefix: str = "") -> None:
    """Hold settings to their least and greatest values.

    Raises:
        ValueError: naming the first that is outside.
    """
    for name, (low, high) in ranges.items():
        value = getattr(settings, name)
        if not low <= value <= high:
            raise ValueError(f"{prefix}{name} is {value}, expected a number in [{low:g}, {high:g}]")


def _plain(value: Any) -> Any:
    if is_dataclass(value):
        return plain_settings(value)
    if isinstance(value, Mapping):
        return {str(key): _plain(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    return value.name if isinstance(value, Enum) else value
