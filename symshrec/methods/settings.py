"""What every method's settings have. No torch here: the schema of conf/ is made of these."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from enum import Enum
from typing import TYPE_CHECKING, Any, TypeVar

from symshrec.files.foreign import is_whole

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Kind = TypeVar("Kind", bound="DataclassInstance")
LARGEST = 65_536  # of a network that weights may bring: far above any that a machine could use
DEEP = ("depth", "layers")  # settings that say how many layers there are
BESIDE = ("name", "workers")  # settings that don't tell how a method was changed
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
        network: the dataclass of the network's settings; each method puts its own kind here.
    """

    weights: tuple[str, ...] = field(default=(), metadata=HARMLESS)
    network: Any = None

    def __post_init__(self):
        super().__post_init__()
        object.__setattr__(self, "weights", tuple(self.weights))


def plain_settings(settings) -> dict[str, Any]:
    """Settings as what JSON holds: nested dicts, enums by name, tuples as lists."""
    return {each.name: _plain(getattr(settings, each.name)) for each in fields(settings)}


def changed_settings(settings: MethodSettings) -> dict[str, Any]:
    """Those settings that are not their class's defaults, by dotted name; not the method's name, nor its workers.

    >>> changed_settings(MethodSettings(refine=True, workers=2))
    {'refine': True}
    """
    given, usual = (_dotted(plain_settings(each)) for each in (settings, type(settings)()))
    return {name: value for name, value in given.items() if name not in BESIDE and value != usual.get(name)}


def _dotted(plain: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    found = {}
    for name, value in plain.items():
        found |= _dotted(value, f"{prefix}{name}.") if isinstance(value, Mapping) else {f"{prefix}{name}": value}
    return found


def restored_settings(
    kind: type[Kind], plain: Mapping[str, Any], layers: int = LARGEST, prefix: str = "network."
) -> Kind:
    """Settings of a kind from what `plain_settings` gave, read from a file that anyone may have written.

    Args:
        layers: more than so many a network cannot have; its weights' tensors.
        prefix: of the settings' names in errors.

    Raises:
        ValueError: naming the setting that the kind does not have, or whose value is of another type or beyond all
            sense.
    """
    defaults, values = kind(), {}
    known = {each.name for each in fields(kind)}
    for name, value in plain.items():
        if not isinstance(name, str) or name not in known:
            raise ValueError(f"{prefix}{str(name)[:40]} is no setting of this method")
        most = layers if name in DEEP else LARGEST
        values[name] = _restored(f"{prefix}{name}", value, getattr(defaults, name), most)
    return kind(**values)


def _restored(name: str, value, default, most: int):
    """A plain value as one of its default's type."""
    wrong = ValueError(f"{name} is {str(value)[:40]!r}; it must be like {default} and a number at most {most}")
    if is_dataclass(default) and not isinstance(default, type):
        if not isinstance(value, Mapping):
            raise wrong
        return restored_settings(type(default), value, prefix=f"{name}.")
    match default:
        case Enum():
            if not isinstance(value, str) or value not in type(default).__members__:
                raise ValueError(f"{name} is {str(value)[:40]!r}; it must be {' or '.join(type(default).__members__)}")
            return type(default)[value]
        case bool() | None:
            if not isinstance(value, bool | None):
                raise wrong
        case int():
            if not is_whole(value, 0, most):
                raise wrong
        case float():
            if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= most:
                raise wrong
        case tuple():
            if not isinstance(value, list | tuple) or not all(is_whole(each, 0, most) for each in value):
                raise wrong
            return tuple(value)
    return value


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
