"""§2.1–2.2 The benchmark on disk: shards of variable-length clouds with their planes and labels, memory-mapped."""

from bisect import bisect_right
from collections import OrderedDict
from pathlib import Path

import numpy as np

from symshrec.benchmark.cloud import LabelledCloud, Labels
from symshrec.benchmark.manifest import Manifest, ShardError, damages, read_manifest
from symshrec.benchmark.shard_file import LABELS, MappedShard, encode_shard
from symshrec.planes import Planes

METADATA = "symshrec"  # the one key, which holds all as JSON
DTYPES = {"F32": np.float32, "F64": np.float64, "I64": np.int64, "U8": np.uint8}
MAPPED_SHARDS = 160  # each holds one file descriptor

__all__ = ["Manifest", "ShardError", "ShardedSplit", "encode_shard", "read_manifest"]


def cloud_name(split: str, index: int) -> str:
    """The name under which a generated cloud appears in lists and figures."""
    return f"{split}-{index:06d}"


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
        """The cloud at `index` (negative counts from the end); its arrays are copies, free to change.

        Raises:
            ShardError: for a file that is no shard, naming the array or field, and for points that are not finite.
        """
        index, shard, row = self._locate(index)
        points = shard.rows("points", "point_starts", row).copy()
        if not np.isfinite(points).all():
            raise ShardError(f"{self.root}: cloud {index} of {self.split} has points that are not finite; make it anew")
        normals = shard.rows("plane_normals", "plane_starts", row)
        planes = Planes(normals, shard.rows("plane_points", "plane_starts", row).copy())
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
                "\n".join(lines) + "\nRun symshrec generate with the configuration of this folder again: it keeps "
                "whole shards and makes only these anew"
            )

    def _locate(self, index: int) -> tuple[int, MappedShard, int]:
        if not -len(self) <= index < len(self):
            raise IndexError(f"cloud {index} of {len(self)} in split {self.split!r} of {self.root}")
        index = int(index) % len(self)
        place = bisect_right(self._firsts, index) - 1
        return index, self._shard(place), index - self._firsts[place]

    def _shard(self, place: int) -> MappedShard:
        """The shard, mapped at first use; the one unused for longest goes when there are too many."""
        if place in self._mapped:
            self._mapped.move_to_end(place)
            return self._mapped[place]
        record = self._records[place]
        path = self.root / record.file
        try:
            shard = self._mapped[place] = MappedShard(path, record)
        except (OSError, ValueError) as error:
            raise ShardError(f"{path} is not a readable shard ({error}); verify=True says how to mend it") from error
        if len(self._mapped) > MAPPED_SHARDS:
            self._mapped.popitem(last=False)
        return shard

    def _labels(self, shard: MappedShard, row: int) -> Labels:
        arrays, about = shard.arrays, shard.about
        named = {label: about[label][arrays[label][row]] for label in LABELS}
        values = zip(about["parameters"], arrays["parameters"][row].tolist(), strict=True)
        parameters = {name: value for name, value in values if value == value}
        pose = {"rotation": arrays["rotation"][row].copy(), "translation": arrays["translation"][row].copy()}
        return Labels(**named, parameters=parameters, **pose)

    def _all(self, label: str) -> np.ndarray:
        if label not in self._names:
            names = [self._shard(place).names(label) for place in range(len(self._records))]
            self._names[label] = np.concatenate(names)
        return self._names[label].copy()
