"""§2.1–2.2 One shard on disk: variable-length clouds end to end with their planes and labels, mapped into memory."""

import json
import mmap
from pathlib import Path
from typing import Any

import numpy as np

from symshrec.benchmark.cloud import (
    ALL_FAMILIES,
    ALL_SOLIDS,
    FAMILIES,
    HARD_PERTURBATIONS,
    PERTURBATIONS,
    PUBLISHED_PERTURBATIONS,
    SOLIDS,
    LabelledCloud,
)
from symshrec.benchmark.manifest import ShardRecord
from symshrec.files.foreign import is_whole, parse_json

METADATA = "symshrec"  # a single key: safetensors does not keep several in a fixed order
HEADER = "__metadata__"
# The names that a shard may list, the shortest list that suffices: so longer ones change no shard made without them.
NAMES = {
    "family": (FAMILIES, ALL_FAMILIES),
    "solid": (SOLIDS, ALL_SOLIDS),
    "perturbation": (PUBLISHED_PERTURBATIONS, PUBLISHED_PERTURBATIONS + HARD_PERTURBATIONS, PERTURBATIONS),
}
LABELS = tuple(NAMES)
# In the order in which a file holds them.
DTYPES: dict[str, type[np.generic]] = {"I64": np.int64, "F64": np.float64, "F32": np.float32, "U8": np.uint8}
ROUNDING = 1e-6  # that lengths of normals and rotations may be off one


def encode_shard(clouds: list[LabelledCloud], split: str) -> list[memoryview]:
    """The file of consecutive clouds of a split: safetensors, arrays end to end with their starts.

    It comes in parts to be written one after the other, so that nothing is copied before.

    points (ΣN, 3) float32 with point_starts (C + 1,); plane_normals, plane_points (ΣK, 3) float64 with plane_starts;
    family, solid, perturbation (C,) uint8, places in the names kept as metadata; rotation (C, 3, 3), translation (C, 3)
    and parameters (C, P) float64, NaN where a parameter does not apply.
    """
    parameters = sorted({name for cloud in clouds for name in cloud.labels.parameters})
    labels = [cloud.labels for cloud in clouds]
    listed = {label: _shortest(label, {getattr(each, label) for each in labels}) for label in LABELS}
    arrays = {
        "point_starts": _starts(len(cloud.points) for cloud in clouds),
        "plane_normals": np.concatenate([cloud.truth.normals for cloud in clouds]),
        "plane_points": np.concatenate([cloud.truth.points for cloud in clouds]),
        "plane_starts": _starts(len(cloud.truth) for cloud in clouds),
        **{
            label: np.array([names.index(getattr(each, label)) for each in labels], dtype=np.uint8)
            for label, names in listed.items()
        },
        "rotation": np.array([each.rotation for each in labels], dtype=float),
        "translation": np.array([each.translation for each in labels], dtype=float),
        "parameters": np.array(
            [[each.parameters.get(name, np.nan) for name in parameters] for each in labels], dtype=float
        ),
    }
    about = {"split": split, "first": clouds[0].id, "parameters": parameters, **listed}
    pieces = {"points": [cloud.points for cloud in clouds], **{name: [array] for name, array in arrays.items()}}
    return _parts(pieces, json.dumps(about, sort_keys=True))


def _parts(pieces: dict[str, list[np.ndarray]], about: str) -> list[memoryview]:
    """A safetensors file of arrays given in pieces, to the byte as its library lays it out: by type, then by name."""
    header: dict[str, Any] = {HEADER: {METADATA: about}}
    content: list[memoryview] = []
    end = 0
    for code, kind in DTYPES.items():
        for name, parts in sorted(each for each in pieces.items() if each[1][0].dtype == kind):
            start, end = end, end + sum(part.nbytes for part in parts)
            shape = [sum(map(len, parts)), *parts[0].shape[1:]]
            header[name] = {"dtype": code, "shape": shape, "data_offsets": [start, end]}
            content += [part.ravel().view(np.uint8).data for part in parts]
    text = json.dumps(header, ensure_ascii=False, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 8)  # so that the arrays are aligned
    return [memoryview(len(text).to_bytes(8, "little")), memoryview(text), *content]


def _shortest(label: str, needed: set[str]) -> tuple[str, ...]:
    return next(names for names in NAMES[label] if needed.issubset(names))


def _starts(lengths) -> np.ndarray:
    return np.concatenate([[0], np.cumsum(list(lengths))]).astype(np.int64)


class MappedShard:
    """One shard file mapped into memory: `arrays` as read-only views, and `about`, its metadata.

    All but the points is held against what `encode_shard` guarantees and the manifest records; those are left on the
    disk until they are asked for.

    Raises:
        ValueError: naming the array or the field that is not as it must be. OSError: where the file cannot be opened.
    """

    def __init__(self, path: Path, record: ShardRecord):
        with open(path, "rb") as file:
            content = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        size = int.from_bytes(content[:8], "little")
        if size > len(content) - 8:
            raise ValueError(f"its header claims {size} bytes of {len(content)}")
        header = parse_json(content[8 : 8 + size])
        if not isinstance(header, dict) or not isinstance(header.get(HEADER), dict):
            raise ValueError("its header is no list of arrays with metadata")
        self.about = parse_json(header.pop(HEADER).get(METADATA, ""))
        _check_about(self.about, record)
        self.arrays = {name: _view(content, 8 + size, name, entry) for name, entry in header.items()}
        _check_arrays(self.arrays, self.about, record)

    def names(self, label: str) -> np.ndarray:
        """A label's name for every cloud, (C,) of str."""
        return np.array(self.about[label])[self.arrays[label]]

    def rows(self, name: str, starts: str, row: int) -> np.ndarray:
        """The part of an array that belongs to the cloud at `row` of the shard."""
        begin, end = self.arrays[starts][row : row + 2]
        return self.arrays[name][begin:end]


def _view(content: mmap.mmap, start: int, name: str, entry) -> np.ndarray:
    """An array of the file by its entry in the header."""
    fields: dict[str, Any] = entry if isinstance(entry, dict) else {}
    dtype, shape, offsets = (fields.get(key, "") for key in ("dtype", "shape", "data_offsets"))
    known = isinstance(dtype, str) and dtype in DTYPES
    if not known or not all(isinstance(each, list) and all(map(is_whole, each)) for each in (shape, offsets)):
        raise ValueError(f"{name} has the entry {str(entry)[:80]}, which describes no array of a shard")
    count, kind = 1, np.dtype(DTYPES[dtype])
    for length in shape:
        count *= length
    if len(offsets) != 2 or offsets[1] - offsets[0] != count * kind.itemsize or start + offsets[1] > len(content):
        raise ValueError(f"{name} of shape {shape} does not lie at {offsets} of the file's {len(content)} bytes")
    return np.frombuffer(content, kind, count, start + offsets[0]).reshape(shape)


def _check_about(about, record: ShardRecord) -> None:
    """Hold the metadata against the manifest's record."""
    if not isinstance(about, dict):
        raise ValueError("its metadata are no record of labels")
    for name in ("split", "first"):
        if about.get(name) != getattr(record, name):
            raise ValueError(f"its {name} is {about.get(name)!r}; the manifest has {getattr(record, name)!r}")
    for name in (*LABELS, "parameters"):
        names = about.get(name)
        if not isinstance(names, list) or not all(isinstance(each, str) for each in names):
            raise ValueError(f"its {name} are {str(names)[:60]}; they must be a list of names")
        if len(set(names)) < len(names):
            raise ValueError(f"its {name} are {str(names)[:60]}, one of them twice")
    for name, (*_, known) in NAMES.items():
        names = about[name]
        if tuple(names) != known[: len(names)]:
            raise ValueError(f"its {name} are {str(names)[:60]}; ours are {', '.join(known)}, in this order")


def _check_arrays(arrays: dict[str, np.ndarray], about: dict, record: ShardRecord) -> None:
    """Hold the arrays against each other, the metadata and the manifest's record."""
    clouds, planes = record.clouds, len(arrays.get("plane_normals", ()))
    expected = {
        "points": (np.float32, (record.points, 3)),
        "point_starts": (np.int64, (clouds + 1,)),
        "plane_normals": (np.float64, (planes, 3)),
        "plane_points": (np.float64, (planes, 3)),
        "plane_starts": (np.int64, (clouds + 1,)),
        **{name: (np.uint8, (clouds,)) for name in LABELS},
        "rotation": (np.float64, (clouds, 3, 3)),
        "translation": (np.float64, (clouds, 3)),
        "parameters": (np.float64, (clouds, len(about["parameters"]))),
    }
    if arrays.keys() != expected.keys():
        raise ValueError(f"it holds the arrays {sorted(arrays)}, expected {sorted(expected)}")
    for name, (dtype, shape) in expected.items():
        if (arrays[name].dtype, arrays[name].shape) != (dtype, shape):
            found = f"{arrays[name].dtype} {arrays[name].shape}"
            raise ValueError(f"{name} is {found}, expected {np.dtype(dtype)} {shape}")
    for name, total, least in (("point_starts", record.points, 1), ("plane_starts", planes, 0)):
        starts = arrays[name]
        if starts[0] != 0 or starts[-1] != total or (starts[1:] < starts[:-1] + least).any():
            raise ValueError(f"{name} do not ascend from 0 to {total}")
    if np.diff(arrays["plane_starts"]).max() != record.max_planes:
        raise ValueError(f"no cloud has the {record.max_planes} planes that the manifest records as the most")
    recorded = {"family": record.families, "solid": record.solids, "perturbation": record.perturbations}
    for name in LABELS:
        if arrays[name].max() >= len(about[name]):
            raise ValueError(f"{name} {arrays[name].max()} is beyond its {len(about[name])} names")
        counts = np.bincount(arrays[name], minlength=len(about[name])).tolist()
        if {each: count for each, count in zip(about[name], counts, strict=True) if count} != recorded[name]:
            raise ValueError(f"{name} has other counts than the manifest records")
    _check_values(arrays)


def _check_values(arrays: dict[str, np.ndarray]) -> None:
    """Refuse planes, poses and parameters that no cloud can have."""
    for name in ("plane_normals", "plane_points", "rotation", "translation"):
        if not np.isfinite(arrays[name]).all():
            raise ValueError(f"{name} holds values that are not finite")
    if np.isinf(arrays["parameters"]).any():
        raise ValueError("parameters holds values that are infinite")
    normals, rotation = arrays["plane_normals"], arrays["rotation"]
    with np.errstate(over="ignore", invalid="ignore"):
        if (np.abs(np.linalg.norm(normals, axis=1) - 1) > ROUNDING).any():
            raise ValueError("plane_normals are not of length one")
        if not (np.abs(rotation @ rotation.transpose(0, 2, 1) - np.eye(3)) <= ROUNDING).all():
            raise ValueError("rotation holds matrices that are no rotations")
