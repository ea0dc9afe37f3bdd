"""§2.2 A split of the benchmark as the organisers hand it out: a folder of text files, opened like our own shards."""

import hashlib
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from symshrec.benchmark.cloud import LabelledCloud, Labels
from symshrec.benchmark.official.layouts import LAYOUTS, Listing
from symshrec.benchmark.official.numbers import OfficialFileError
from symshrec.benchmark.official.text import read_subset
from symshrec.files.foreign import is_plain_name

SPLITS = ("train", "valid", "test")


class OfficialFolder:
    """The clouds of one split, sorted by ID, each read when asked for.

    Args:
        root: the split's own folder, or the folder of `benchmark-train/` and `benchmark-test/` (`train/`, `valid/` and
            `test/` for the successor). Without any truth in it the truth counts as withheld, and planes are None.
        subset: a text file with one ID a line, or the IDs themselves; None takes all.
        split: which split of `root`; None where there is only one.
        points: a folder with the points, where `root` has only the truth.

    Attributes:
        ids (C,) int64; names, families, solids, perturbations (C,) str.
        fingerprint: changes when the files do (by name, size and time of change).

    Raises:
        OfficialFileError: for a folder without clouds, two files for one ID, points without truth where others have it,
            truth without points, and a subset's ID that is not in the folder. Malformed files raise when they are read.
    """

    def __init__(
        self,
        root: str | Path,
        subset: str | Path | Sequence[int] | None = None,
        split: str | None = None,
        points: str | Path | None = None,
    ):
        self.root = split_folder(Path(root), split)
        truth_listing = Listing.of(self.root)
        points_listing = truth_listing if points is None else Listing.of(split_folder(Path(points), split))
        self._read_points = points_listing.layout.read_points
        self._read_planes = truth_listing.layout.read_planes
        self._points, self._truths = points_listing.points, truth_listing.truths
        cloud_ids = _matched_ids(truth_listing, points_listing)
        self.ids = np.array(cloud_ids if subset is None else chosen_ids(cloud_ids, subset, self.root), dtype=np.int64)
        self._labels = [truth_listing.labels(cloud) for cloud in self.ids.tolist()]
        self.names = np.array([truth_listing.stem(cloud) for cloud in self.ids.tolist()])
        self.families = np.array([labels.family for labels in self._labels])
        self.solids = np.array([labels.solid for labels in self._labels])
        self.perturbations = np.array([labels.perturbation for labels in self._labels])

    def __len__(self) -> int:
        return len(self.ids)

    def __getitem__(self, position: int) -> LabelledCloud:
        """The cloud at a position, its points float64, as they stand in their file.

        Raises:
            OfficialFileError: naming file and line, where one of its files is malformed.
        """
        cloud = int(self.ids[position])
        planes = self._read_planes(self._truths[cloud]) if self.has_truth else None
        points = self._read_points(self._points[cloud])
        return LabelledCloud(points, planes, self.labels(position), cloud, str(self.names[position]))

    def labels(self, position: int) -> Labels:
        """What the names of a cloud's files say about it, without reading them."""
        return self._labels[position]

    @property
    def has_truth(self) -> bool:
        """Whether the true planes are there."""
        return bool(self._truths)

    @property
    def fingerprint(self) -> str:
        digest = hashlib.sha256()
        for cloud in self.ids.tolist():
            for path in (self._points[cloud], self._truths.get(cloud)):
                state = path.stat() if path else None
                digest.update(f"{path and path.name} {state and (state.st_size, state.st_mtime_ns)}\n".encode())
        return digest.hexdigest()


def split_folder(root: Path, split: str | None) -> Path:
    """The folder of a split: below `root`, or `root` itself.

    Raises:
        OfficialFileError: for a split that is no single name, where `root` is another split's folder, or where it has
            several splits and none is named.
    """
    if split is not None and not is_plain_name(split):
        raise OfficialFileError(f"{root}: split {split!r} is no name of a folder in it")
    folders = {
        name: root / layout.split_folder.format(split=name)
        for layout in LAYOUTS.values()
        for name in (SPLITS if split is None else (*SPLITS, split))
        if (root / layout.split_folder.format(split=name)).is_dir()
    }
    if split in folders:
        return folders[split]
    others = {layout.split_folder.format(split=name) for layout in LAYOUTS.values() for name in SPLITS if name != split}
    if split is not None and (folders or root.name in others):
        there = ", ".join(folder.name for folder in folders.values()) or root.name
        raise OfficialFileError(
            f"{root}: there is no split {split!r}, only {there}; name one of those, or another folder"
        )
    if len(folders) > 1:
        raise OfficialFileError(f"{root}: there are several splits, {', '.join(folders)}; say which")
    return next(iter(folders.values()), root)


def _matched_ids(truth: Listing, points: Listing) -> list[int]:
    """The IDs to read, ascending: all with points, and with truth unless that is withheld altogether."""
    for cloud in sorted(truth.truths.keys() - points.points.keys()):
        wanted = f"{truth.stem(cloud)}{points.layout.points_suffix}"
        raise OfficialFileError(
            f"{truth.truths[cloud]}: its points, {wanted}, are missing from {points.folder}; add them"
        )
    if points is not truth:
        return sorted(truth.truths)
    for cloud in sorted(points.points.keys() - truth.truths.keys() if truth.truths else ()):
        wanted = f"{points.stem(cloud)}{truth.layout.truth_suffix}"
        raise OfficialFileError(f"{points.points[cloud]}: its truth, {wanted}, is missing; add it or remove the points")
    return sorted(points.points)


def chosen_ids(cloud_ids: Iterable[int], subset: str | Path | Sequence[int], root: Path) -> list[int]:
    """The IDs of a subset, ascending.

    Raises:
        OfficialFileError: for a malformed list, and for an ID that is not among `cloud_ids`, which are those of `root`.
    """
    listed = read_subset(Path(subset)) if isinstance(subset, str | Path) else [int(cloud) for cloud in subset]
    known = set(cloud_ids)
    for line, cloud in enumerate(listed, 1):
        if cloud not in known:
            where = f"{subset}:{line}: " if isinstance(subset, str | Path) else ""
            raise OfficialFileError(f"{where}there is no cloud {cloud} in {root}; remove it from the list")
    return sorted(listed)
