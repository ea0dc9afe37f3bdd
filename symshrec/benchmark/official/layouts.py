"""How the track and its successor lay clouds out in a folder: names of files, readers, and what lies where."""

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from symshrec.benchmark.cloud import LabelledCloud, Labels
from symshrec.benchmark.official import symmetria, text
from symshrec.benchmark.official.numbers import OfficialFileError, cloud_id
from symshrec.planes import Planes


@dataclass(frozen=True)
class Layout:
    """One way to lay a split out: a stem for each cloud, its ID in it, and a suffix for its points and for its truth.

    split_folder: the folder of a split below the root, with `{split}`.
    depth: folders between the split's folder and its files, at most.
    """

    name: str
    stem: re.Pattern
    points_suffix: str
    truth_suffix: str
    split_folder: str
    depth: int
    read_points: Callable[[Path], np.ndarray]
    read_planes: Callable[[Path], Planes]
    write_points: Callable[[Path, np.ndarray], None]
    write_planes: Callable[[Path, Planes], None]
    labels: Callable[[re.Match], Labels]
    place: Callable[[int, Labels], str]

    def write(self, cloud: LabelledCloud, folder: Path) -> None:
        """Write a cloud, and its truth where it is known, into a split's folder; the points last."""
        points, truth = self.paths(cloud.id, cloud.labels, folder)
        points.parent.mkdir(parents=True, exist_ok=True)
        if cloud.planes is not None:
            self.write_planes(truth, cloud.planes)
        self.write_points(points, cloud.points)

    def paths(self, cloud_id: int, labels: Labels, folder: Path) -> tuple[Path, Path]:
        """Where a cloud's points and its true planes go."""
        stem = f"{folder}/{self.place(cloud_id, labels)}"
        return Path(stem + self.points_suffix), Path(stem + self.truth_suffix)

    def files(self, folder: Path) -> Iterator[tuple[Path, str, int]]:
        """Path, suffix and cloud ID of all points and truths in a split's folder, sorted by path.

        Raises:
            OfficialFileError: for an ID that is too large.
        """
        for path in sorted(path for depth in range(self.depth + 1) for path in folder.glob("*/" * depth + "*.*")):
            for suffix in (self.truth_suffix, self.points_suffix):
                stem = self.stem.fullmatch(path.name.removesuffix(suffix)) if path.name.endswith(suffix) else None
                if stem:
                    yield path, suffix, cloud_id(stem["id"], path)
                    break


TRACK = Layout(
    name="track",
    stem=re.compile(r"points(?P<id>[0-9]+)"),
    points_suffix=".txt",
    truth_suffix="_sym.txt",
    split_folder="benchmark-{split}",
    depth=0,
    read_points=text.read_points,
    read_planes=text.read_planes,
    write_points=text.write_points,
    write_planes=text.write_planes,
    labels=lambda stem: Labels(),
    place=lambda cloud_id, labels: f"points{cloud_id}",
)
SYMMETRIA = Layout(
    name="symmetria",
    stem=re.compile(r"(?P<id>[0-9]+)-(?P<family>[^-]+)-(?P<perturbation>.+)"),
    points_suffix=".xz",
    truth_suffix="-sym.txt",
    split_folder="{split}",
    depth=1,
    read_points=symmetria.read_compressed_points,
    read_planes=symmetria.read_symmetries,
    write_points=symmetria.write_compressed_points,
    write_planes=symmetria.write_symmetries,
    labels=lambda stem: symmetria.labels_of(stem["family"], stem["perturbation"]),
    place=lambda cloud_id, labels: f"{symmetria.class_of(labels)}/{symmetria.stem_of(cloud_id, labels)}",
)
LAYOUTS = {layout.name: layout for layout in (TRACK, SYMMETRIA)}


@dataclass(frozen=True)
class Listing:
    """The files of one split: points and truths by cloud ID, in the layout they are laid out in."""

    folder: Path
    layout: Layout
    points: dict[int, Path] = field(default_factory=dict)
    truths: dict[int, Path] = field(default_factory=dict)

    @classmethod
    def of(cls, folder: Path) -> "Listing":
        """What lies in a folder, in whichever layout.

        Raises:
            OfficialFileError: for a folder that is not there, holds no cloud, or holds two files for one ID.
        """
        if not folder.is_dir():
            raise OfficialFileError(f"{folder}: there is no such folder; name one with points<ID>.txt files in it")
        for layout in LAYOUTS.values():
            listing = cls(folder, layout)
            for path, suffix, cloud in layout.files(folder):
                files = listing.points if suffix == layout.points_suffix else listing.truths
                other = files.setdefault(cloud, path)
                if other != path:
                    raise OfficialFileError(f"{path}: {other} is of the same cloud; keep one of the two")
            if listing.points or listing.truths:
                return listing
        raise OfficialFileError(
            f"{folder}: there is no cloud in it; it should hold points<ID>.txt and points<ID>_sym.txt, "
            "or <ID>-<class>-<perturbation>.xz and <ID>-<class>-<perturbation>-sym.txt"
        )

    def stem(self, cloud: int) -> str:
        """The name that a cloud's files share."""
        if cloud in self.points:
            return self.points[cloud].name.removesuffix(self.layout.points_suffix)
        return self.truths[cloud].name.removesuffix(self.layout.truth_suffix)

    def labels(self, cloud: int) -> Labels:
        """What the names of a cloud's files say about it."""
        stem = self.layout.stem.fullmatch(self.stem(cloud))
        assert stem  # `Layout.files` lists no other
        return self.layout.labels(stem)
