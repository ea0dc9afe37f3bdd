"""§2.1–2.2 The benchmark on disk: shards of variable-length clouds with their planes and labels, memory-mapped."""

import json
import mmap
from bisect import bisect_right
from collections import OrderedDict
from pathlib import Path

import numpy as np
from safetensors.numpy import save

from symshrec.benchmark.cloud import (
    ALL_FAMILIES,
    ALL_SOLIDS,
    FAMILIES,
    HARD_PERTURBATIONS,
    PERTURBATIONS,
    PUBLISHED_PERTURBATIONS,
    SOLIDS,
    LabelledCloud,
    Labels,
)
from symshrec.benchmark.manifest import Manifest, damages, read_manifest
from symshrec.files.atomic import ShardError
from symshrec.planes import Planes

METADATA = "symshrec"  # a single key: safetensors does not keep several in a fixed order
DTYPES = {"F32": np.float32, "F64": np.float64, "I64": np.int64, "U8": np.uint8}
# The names that a shard may list, the shortest list that suffices: so longer ones change no shard made without them.
NAMES = {
    "family": (FAMILIES, ALL_FAMILIES),
    "solid": (SOLIDS, ALL_SOLIDS),
    "perturbation": (PUBLISHED_PERTURBATIONS, PUBLISHED_PERTURBATIONS + HARD_PERTURBATIONS, PERTURBATIONS),
}
MAPPED_SHARDS = 160  # each holds one file descriptor

__all__ = ["Manifest", "ShardError", "ShardedSplit", "encode_shard", "read_manifest"]


def encode_shard(clouds: list[LabelledCloud], split: str) -> bytes:
    """The file of consecutive clouds of a split: safetensors, arrays end to end with their starts.

    points (ΣN, 3) float32 with point_starts (C + 1,); plane_normals, plane_points (ΣK, 3) float64 with plane_starts;
    family, solid, perturbation (C,) uint8, places in the names kept as metadata; rotation (C, 3, 3), translation (C, 3)
    and parameters (C, P) float64, NaN where a parameter does not apply.
    """
    parameters = sorted({name for cloud in clouds for name in cloud.labels.parameters})
    labels = [cloud.labels for cloud in clouds]
    listed = {label: _shortest(label, {getattr(each, label) for each in labels}) for label in NAMES}
    arrays = {
        "points": np.concatenate([cloud.points for cloud in clouds]),
        "point_starts": _starts(len(cloud.points) for cloud in clouds),
        "plane_normals": np.concatenate([cloud.planes.normals for cloud in clouds]),
        "plane_points": np.concatenate([cloud.planes.points for cloud in clouds]),
        "plane_starts": _starts(len(cloud.planes) for cloud in clouds),
        **{
            label: np.array([names.index(getattr(each, label)) for each in labels], dtype=np.uint8)
            for label, names in listed.items()
        },
        "rotation": np.stack([each.rotation for each in labels]),
        "translation": np.stack([each.translation for each in labels]),
        "parameters": np.array(
            [[each.parameters.get(name, np.nan) for name in parameters] for each in labels], dtype=float
        ),
    }
    about = {
        "split": split,
        "first": clouds[0].id,
        "parameters": parameters,
        **listed,
    }
    return save(arrays, {METADATA: json.dumps(about, sort_keys=True)})


def cloud_name(split: str, index: int) -> str:
    """The name under which a generated cloud appears in lists and figures."""
    return f"{split}-{index:06d}"


def _shortest(label: str, needed: set[str]) -> tuple[str, ...]:
    return next(names for names in NAMES[label] if needed.issubset(names))


def _starts(lengths) -> np.ndarray:
    return np.concatenate([[0], np.cumsum(list(lengths))]).astype(np.int64)


class _Shard:
    """One shard file mapped into memory: arrays as read-only views, and the metadata."""

    def __init__(self, path: Path):
        with open(path, "rb") as file:
            content = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        size = int.from_bytes(content[:8], "little")
        header = json.loads(content[8 : 8 + size])
        self.about = json.loads(header.pop("__metadata__")[METADATA])
        self.arrays = {}
        for name, entry in header.items():
            dtype = np.dtype(DTYPES[entry["dtype"]])
            begin, end = entry["data_offsets"]
            flat = np.frombuffer(content, dtype, (end - begin) // dtype.itemsize, 8 + size + begin)
            self.arrays[name] = flat.reshape(entry["shape"])

    def names(self, label: str) -> np.ndarray:
        """A label's name for every cloud, (C,) of str."""
        return np.array(self.about[label])[self.arrays[label]]


class ShardedSplit:
    """The clouds of one split by position; a cloud is read when asked for.

    Pickles as a path and a few counts, and maps its files again in every process that reads them.

    Args:
        root: folder of a finished generation. split: one of the manifest's.
        verify: compare every shard with the manifest's sha256 (about 1 s per 2 GB); sizes are compared in any case.

    Raises:
        ShardError: for a missing manifest or split, or naming each shard that is missing, truncated or altered.
    """

    def __init__(self, root: str | Path, split: str, verify: bool = True):
        self.root, self.split = Path(root), split
        self.manifest = read_manifest(self.root)
        if split not in self.manifest.splits:
            raise ShardError(f"{self.root} has no split {split!r}; it has {', '.join(self.manifest.splits)}")
        self._records = [each for each in self.manifest.shards if each.split == split]
        self._firsts = [each.first for each in self._records]
        self._mapped = OrderedDict()
        self._names = {}
        self._refuse_damage(verify)

    def __len__(self) -> int:
        return self.manifest.splits[self.split].clouds

    def __getitem__(self, index: int) -> LabelledCloud:
        """The cloud at `index` (negative counts from the end); its arrays are copies, free to change."""
        index, shard, row = self._locate(index)
        points = _rows(shard.arrays, "points", "point_starts", row).copy()
        normals = _rows(shard.arrays, "plane_normals", "plane_starts", row)
        planes = Planes(normals, _rows(shard.arrays, "plane_points", "plane_starts", row).copy())
        return LabelledCloud(points, planes, self._labels(shard, row), index, cloud_name(self.split, index))

    def labels(self, index: int) -> Labels:
        """The labels of the cloud at `index`, without reading its points."""
        _, shard, row = self._locate(index)
        return self._labels(shard, row)

    @property
    def families(self) -> np.ndarray:
        """Family of every cloud, (C,) of str."""
        return self._all("family")

    @property
    def solids(self) -> np.ndarray:
        """cylinder or cone for every cloud, (C,) of str."""
        return self._all("solid")

    @property
    def perturbations(self) -> np.ndarray:
        """Perturbation of every cloud, (C,) of str."""
        return self._all("perturbation")

    @property
    def fingerprint(self) -> str:
        """Changes when the data does: the manifest's hash."""
        return self.manifest.hash

    def __getstate__(self) -> dict:
        return self.__dict__ | {"_mapped": OrderedDict(), "_names": {}}

    def _refuse_damage(self, contents: bool) -> None:
        found = damages(self.root, self._records, contents)
        lines = [f"{self.root / each.file} {what}" for each, what in zip(self._records, found, strict=True) if what]
        if lines:
            raise ShardError(
                "\n".join(lines)
                + "\nRun experiments/generate.py with the configuration of this folder again: it keeps "
                "whole shards and makes only these anew"
            )

    def _locate(self, index: int) -> tuple[int, _Shard, int]:
        if not -len(self) <= index < len(self):
            raise IndexError(f"cloud {index} of {len(self)} in split {self.split!r} of {self.root}")
        index = int(index) % len(self)
        place = bisect_right(self._firsts, index) - 1
        return index, self._shard(place), index - self._firsts[place]

    def _shard(self, place: int) -> _Shard:
        """The shard, mapped at first use; the one unused for longest goes when there are too many."""
        if place in self._mapped:
            self._mapped.move_to_end(place)
            return self._mapped[place]
        path = self.root / self._records[place].file
        try:
            shard = self._mapped[place] = _Shard(path)
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise ShardError(f"{path} is not a readable shard ({error}); verify=True says how to mend it") from error
        if len(self._mapped) > MAPPED_SHARDS:
            self._mapped.popitem(last=False)
        return shard

    def _labels(self, shard: _Shard, row: int) -> Labels:
        arrays, about = shard.arrays, shard.about
        named = {label: about[label][arrays[label][row]] for label in ("family", "solid", "perturbation")}
        values = zip(about["parameters"], arrays["parameters"][row].tolist(), strict=True)
        parameters = {name: value for name, value in values if value == value}
        pose = {"rotation": arrays["rotation"][row].copy(), "translation": arrays["translation"][row].copy()}
        return Labels(**named, parameters=parameters, **pose)

    def _all(self, label: str) -> np.ndarray:
        if label not in self._names:
            names = [self._shard(place).names(label) for place in range(len(self._records))]
            self._names[label] = np.concatenate(names)
        return self._names[label].copy()


def _rows(arrays: dict[str, np.ndarray], name: str, starts: str, row: int) -> np.ndarray:
    begin, end = arrays[starts][row : row + 2]
    return arrays[name][begin:end]
