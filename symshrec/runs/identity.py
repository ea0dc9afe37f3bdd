"""What a stored run is: the declared things that decide its predictions, as plain values and as one digest.

Code counts by the version that its class states, not by its bytes, so that a comment never costs hours. Where a class
of another package states none, its source stands in the version's place.
"""

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from enum import Enum
from pathlib import Path

import numpy as np

import symshrec
from symshrec.runs.source import source_digest


def method_identity(method) -> dict[str, str | int]:
    """The versions of the method's class and of the methods that it extends, by name.

    A version counts for the class that states it alone: what a subclass changes, its parent's version cannot know. A
    class that states none is known by its source (see `source_digest`) and by this package's release.

    Args:
        method: a `SymmetryMethod`.

    Raises:
        ValueError: for a class without a version whose source cannot be read.
    """
    known = {}
    for kind in type(method).__mro__:
        if (version := vars(kind).get("version")) is not None and _ours(kind):
            known[vars(kind).get("name") or _path(kind)] = version
        elif _ours(kind) and (kind is type(method) or not _in_package(kind)):
            known |= {_path(kind): source_digest(kind), "symshrec": symshrec.__version__}
    return known


def decisive_settings(settings) -> dict:
    """A method's settings, as plain values, without the fields that are marked `HARMLESS`; `refine` counts apart.

    A setting that names a file counts by the file's content.
    """
    return {name: value for name, value in _plain(settings).items() if name != "refine"}


def run_identity(
    method,
    *,
    data: str,
    positions: np.ndarray,
    sampling: Mapping,
    seed: int,
    precision: str,
    refinement: int,
) -> dict:
    """All that decides the predictions of a run.

    Args:
        method: a `SymmetryMethod`.
        data: content hash of the split. positions: (C,) int64, of its clouds that the run takes.
        sampling: how points are drawn. seed: of all chance. precision: of the networks' arithmetic.
        refinement: version of the refinement; it counts only where the method refines.

    Raises:
        ValueError: see `method_identity`.
    """
    weights = [each["sha256"] for each in getattr(method, "weights_record", None) or ()] or _network(method)
    chosen = hashlib.sha256(np.ascontiguousarray(positions, dtype=np.int64).tobytes()).hexdigest()
    return {
        "code": method_identity(method),
        "method": decisive_settings(method.settings),
        **({"weights": weights} if weights else {}),
        "data": {"sha256": data, "positions": chosen},
        "sampling": dict(sampling),
        "seed": seed,
        "precision": precision,
        **({"refinement": refinement} if method.refine else {}),
    }


def unrefined(identity: Mapping) -> dict:
    """The identity of the same run without refinement."""
    return {name: value for name, value in identity.items() if name != "refinement"}


def digest(identity: Mapping) -> str:
    """sha256 over an identity, whatever the order of its keys."""
    return hashlib.sha256(json.dumps(identity, sort_keys=True).encode()).hexdigest()


def differences(stored: Mapping, asked: Mapping) -> list[str]:
    """One phrase for everything that differs, such as "method.neighbours: 200 → 250"; hashes are cut short."""
    before, after = dict(_flat(stored)), dict(_flat(asked))
    keys = [*after, *(key for key in before if key not in after)]
    pairs = ((key, before.get(key, "none"), after.get(key, "none")) for key in keys)
    return [f"{key}: {_short(old)} → {_short(new)}" for key, old, new in pairs if old != new]


def _network(method) -> list[str]:
    """sha256 of the parameters and buffers of a method whose network came from no weights file; empty without one."""
    state = method.state_dict()
    found = hashlib.sha256()
    for name, tensor in sorted(state.items()):
        array = tensor.detach().cpu().float().contiguous().numpy()
        found.update(f"{name} {array.shape}".encode() + array.tobytes())
    return [found.hexdigest()] if state else []


def _ours(kind: type) -> bool:
    """Whether a class is a method, and not one of the frameworks or mixins that a method stands on."""
    return any(each.__module__ == "symshrec.methods.base" for each in kind.__mro__)


def _in_package(kind: type) -> bool:
    return kind.__module__.partition(".")[0] == "symshrec"


def _path(kind: type) -> str:
    return f"{kind.__module__}.{kind.__qualname__}"


def _plain(value: object) -> object:
    """A setting as JSON holds it: enums by name, files by content, dataclasses without their harmless fields."""
    if is_dataclass(value) and not isinstance(value, type):
        kept = (each for each in fields(value) if not each.metadata.get("harmless"))
        return {each.name: _plain(getattr(value, each.name)) for each in kept}
    if isinstance(value, Enum):
        return value.name
    if isinstance(value, Mapping):
        return {str(name): _plain(each) for name, each in value.items()}
    if hasattr(value, "tolist"):  # an array
        return value.tolist()
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [_plain(each) for each in value]
    if isinstance(value, str | Path) and (content := _content(Path(value))):
        return content
    return value if isinstance(value, str | int | float | None) else str(value)


def _content(path: Path) -> str | None:
    try:
        return f"sha256 {hashlib.sha256(path.read_bytes()).hexdigest()}" if path.is_file() else None
    except (OSError, ValueError):  # no name of a file at all
        return None


def _flat(node: object, prefix: str = "") -> Iterator[tuple[str, object]]:
    if not isinstance(node, Mapping):
        yield prefix.removesuffix("."), node
        return
    for key, value in node.items():
        yield from _flat(value, f"{prefix}{key}.")


def _short(value: object) -> str:
    text = ", ".join(map(_short, value)) if isinstance(value, list) else str(value)
    return f"{text[:12]}…" if len(text) == 64 and text.isalnum() else text
