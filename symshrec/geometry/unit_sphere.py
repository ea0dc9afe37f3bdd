"""§3.1 step 1: clouds on the unit sphere, as networks see them, and planes brought back from there."""

from collections.abc import Sequence
from dataclasses import dataclass

from torch import Tensor

from symshrec.planes import Planes

SMALLEST = 1e-12  # radius that a cloud is divided by at least


@dataclass(frozen=True, eq=False)
class UnitSphere:
    """Where B clouds lie (§3.1, step 1): centres (B, 1, 3) and radii (B, 1, 1) of their points about their mean.

    >>> import torch
    >>> clouds = torch.tensor([[[1.0, 0, 0], [5, 0, 0]]])
    >>> frame = UnitSphere.of(clouds)
    >>> frame.apply(clouds).tolist()
    [[[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]]]
    >>> frame.restored([Planes([[1, 0, 0]], [[0, 0, 0]])])[0].points.tolist()
    [[3.0, 0.0, 0.0]]
    """

    centres: Tensor
    radii: Tensor

    @classmethod
    def of(cls, points: Tensor) -> "UnitSphere":
        """Measure clouds (B, N, 3)."""
        centres = points.mean(1, keepdim=True)
        radii = (points - centres).norm(dim=-1).amax(1)[:, None, None]
        return cls(centres, radii.clamp_min(SMALLEST))

    def apply(self, points: Tensor) -> Tensor:
        """(B, N, 3), or one point each (B, 3), on the unit sphere."""
        if points.ndim == 2:
            return self.apply(points[:, None])[:, 0]
        return (points - self.centres) / self.radii

    def restored(self, planes: Sequence[Planes]) -> list[Planes]:
        """Planes of every cloud of the sphere in the clouds' own coordinates."""
        frames = zip(self.radii.flatten().tolist(), self.centres[:, 0].double().cpu().numpy(), strict=True)
        return [each.transformed(scale=r, translation=c) for each, (r, c) in zip(planes, frames, strict=True)]
