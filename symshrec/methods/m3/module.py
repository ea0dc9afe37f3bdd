"""§3.3 M3 as a SymmetryMethod: nothing to train, on the CPU, in one process or several."""

from typing import cast

from torch import Tensor

from symshrec.data.batch import Batch
from symshrec.files.pool import Find
from symshrec.methods.base import SymmetryMethod
from symshrec.methods.m3.pipeline import detect_diffused, detect_planes, diffused
from symshrec.methods.m3.settings import M3Settings
from symshrec.planes import Planes


class M3(SymmetryMethod):
    """Diffusion-based symmetry detection."""

    name = "m3"
    Settings = M3Settings
    settings: M3Settings
    version = 1

    def detect(self, points: Tensor) -> Planes:
        """The planes of one cloud (N, 3), computed in this process; see `detect_planes` for what it raises."""
        return detect_planes(points.detach().cpu().numpy(), self.settings)

    def detect_batch(self, batch: Batch) -> list[Planes]:
        """The planes of every cloud, in order; errors as in `cloud_by_cloud`.

        With a `shelf`, the diffusion function is computed once for all runs that differ only in what comes after it.
        """
        batch = batch.to("cpu")
        if self.shelf is None:
            return self.cloud_by_cloud(detect_planes, batch, [self.settings] * len(batch))
        mine = self.settings
        spectral = mine.eigenpairs, mine.mollify, mine.laplacian_neighbours, mine.time_factor
        keys = [(position, spectral) for position in batch.positions]
        rows = [row for row, key in enumerate(keys) if key not in self.shelf]
        if rows:
            new = self.cloud_by_cloud(cast(Find, diffused), batch.select(rows), [mine] * len(rows))
            self.shelf.update(zip([keys[row] for row in rows], new, strict=True))
        known = [(mine, self.shelf[key]) for key in keys]
        return self.cloud_by_cloud(detect_diffused, batch, known)
