"""Any folder of clouds and meshes, opened like a split of the benchmark whose truth is withheld."""

import hashlib
from pathlib import Path

import numpy as np

from symshrec.benchmark.cloud import LabelledCloud, Labels
from symshrec.scans.cloud import CloudFileError
from symshrec.scans.formats import is_known, listed
from symshrec.scans.reading import read_cloud


class CloudFolder:
    """Every file below a folder that `read_cloud` knows by its extension, sorted by path, each read when asked for.

    Attributes:
        ids (C,) int64: places in that order; names (C,): paths below the folder; families, solids, perturbations (C,):
            unknown.
        fingerprint: changes when the files do (by path, size and time of change).

    Raises:
        CloudFileError: for a folder without such files; a file that cannot be read raises when its cloud is asked for.
    """

    def __init__(self, root: str | Path):
        self.root = Path(root)
        self._paths = sorted(path for path in self.root.rglob("*") if is_known(path) and path.is_file())
        if not self._paths:
            raise CloudFileError(f"{self.root}: there is no cloud below it; what can be read: {listed()}")
        self.ids = np.arange(len(self._paths))
        self.names = np.array([str(path.relative_to(self.root)) for path in self._paths])
        self.families, self.solids, self.perturbations = (np.full(len(self), Labels().family) for _ in range(3))

    def __len__(self) -> int:
        return len(self._paths)

    def __getitem__(self, position: int) -> LabelledCloud:
        """The cloud at a position, float32 in the file's own units about its box's centre, so that a place far from the
        origin costs no precision; a mesh is points drawn on its surface."""
        points = read_cloud(self._paths[position]).points
        points = (points - (points.min(axis=0) + np.ptp(points, axis=0) / 2)).astype(np.float32)
        return LabelledCloud(points, None, self.labels(position), int(position), str(self.names[position]))

    def labels(self, position: int) -> Labels:
        """Nothing is known."""
        return Labels()

    @property
    def fingerprint(self) -> str:
        digest = hashlib.sha256()
        for path, name in zip(self._paths, self.names, strict=True):
            state = path.stat()
            digest.update(f"{name} {state.st_size} {state.st_mtime_ns}\n".encode())
        return digest.hexdigest()
