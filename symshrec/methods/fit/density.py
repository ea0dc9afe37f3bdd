"""M4 step 1: the density of a cloud on a grid, with its slope, looked up without a tree."""

from functools import cached_property

import torch
from torch import Tensor

from symshrec.methods.fit.steps import columns

# Of the grid, in bandwidths: hat in, hat out and blur have variances of 1/6, 1/6 and 1/2 of a cell squared.
CELL = 1.2**0.5
FARTHEST = 1.1  # from the origin, in units of the cloud's size; what lies beyond is left out
BORDER = 2  # empty cells around the points
BANDWIDTHS = (0.06, 0.04, 0.03, 0.02, 0.014)  # coarse to fine, shares of the cloud's size
CROWD = 1.5  # other points within the bell of a point, in bells; a bandwidth with fewer is too fine for the cloud
JUDGED = 2000  # points that tell, and that means are taken over


class Density:
    """How densely points lie around any place: every point a bell of standard deviation `bandwidth`.

    The bell is a trilinear splat, a blur (1, 2, 1) / 4 and a trilinear look-up, which together are near a Gaussian.

    Args:
        points: (N, 3) float32, in the frame of `frame_of`. bandwidth: a length.
    """

    def __init__(self, points: Tensor, bandwidth: float):
        self.points, self.bandwidth = points, bandwidth
        self.cell = bandwidth * CELL
        inside = points[(points.abs() <= FARTHEST).all(1)]
        low, high = inside.amin(0), inside.amax(0)
        self.corner = (low - (BORDER + 0.5) * self.cell)[:, None]  # a column, as places are
        self.shape = [int(extent) + 2 * BORDER + 2 for extent in ((high - low) / self.cell).tolist()]
        rows, layers = self.shape[2], self.shape[1] * self.shape[2]
        self._corners = torch.tensor(
            [x * layers + y * rows + z for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=torch.int32
        ).to(points.device)
        first, part = self._places(columns(inside))
        x, y, z = torch.stack([1 - part, part]).unbind(1)  # (2, N) each
        weights = (x[:, None] * y)[:, :, None] * z  # (2, 2, 2, N)
        cells = torch.zeros(self.shape[0] * layers, device=points.device)
        cells.index_add_(0, (self._corners[:, None] + first).flatten(), weights.flatten())
        self.cells = _blurred(cells.reshape(self.shape)).flatten()

    @cached_property
    def mean(self) -> float:
        """The mean of the density at the points."""
        return float(self.at(columns(self.points[:JUDGED])).mean())

    def at(self, places: Tensor) -> Tensor:
        """The density (..., Q) at places (..., 3, Q), a column each; outside the grid about 0."""
        values, (x, y, z) = self._around(places)
        values = torch.lerp(values[:, :, 0], values[:, :, 1], z)
        values = torch.lerp(values[:, 0], values[:, 1], y)
        return torch.lerp(values[0], values[1], x)

    def with_slope(self, places: Tensor) -> tuple[Tensor, Tensor]:
        """The density (..., Q) and its gradient (..., 3, Q) at places (..., 3, Q), a column each."""
        values, (x, y, z) = self._around(places)
        along_z = values[:, :, 1] - values[:, :, 0]
        values = torch.addcmul(values[:, :, 0], along_z, z)
        along_z = torch.lerp(along_z[:, 0], along_z[:, 1], y)
        along_y = values[:, 1] - values[:, 0]
        values = torch.addcmul(values[:, 0], along_y, y)
        along_x = values[1] - values[0]
        slopes = [along_x, torch.lerp(along_y[0], along_y[1], x), torch.lerp(along_z[0], along_z[1], x)]
        return torch.addcmul(values[0], along_x, x), torch.stack(slopes, -2) / self.cell

    def nearest(self, places: Tensor) -> Tensor:
        """The density (..., Q) at the middle of the cell around places (..., 3, Q): coarse, and the fastest."""
        cells = (places - (self.corner - self.cell / 2)) / self.cell
        x, y, z = torch.minimum(cells.clamp_(min=0), self._last + 0.5).to(torch.int32).unbind(-2)
        return self._looked_up((x * self.shape[1] + y) * self.shape[2] + z)

    def of_others(self, points: Tensor) -> Tensor:
        """The density (M,) at (M, 3) of the points that the others make: leave-one-out."""
        return (self.at(columns(points)) - self._own(points)).clamp_min(0)

    @cached_property
    def crowd(self) -> float:
        """The mean density that the others make at a point, in units of what it makes there itself."""
        points = self.points[:JUDGED]
        return float(self.of_others(points).mean() / self._own(points).mean())

    def _own(self, points: Tensor) -> Tensor:
        _, part = self._places(columns(points))
        return (((1 - part).square() + part.square()) * 0.5 + 2 * part * (1 - part) * 0.25).prod(0)

    @cached_property
    def _last(self) -> Tensor:
        return torch.tensor(self.shape, dtype=torch.float32, device=self.points.device)[:, None] - 1

    def _around(self, places: Tensor) -> tuple[Tensor, tuple[Tensor, ...]]:
        """The eight values (2, 2, 2, ..., Q) around places (..., 3, Q), and the parts (..., Q) of the way across."""
        first, part = self._places(places)
        corners = self._corners.reshape(-1, *[1] * first.dim())
        return self._looked_up(corners + first).unflatten(0, (2, 2, 2)), part.unbind(-2)

    def _looked_up(self, cells: Tensor) -> Tensor:
        return self.cells.index_select(0, cells.flatten()).reshape(cells.shape)

    def _places(self, places: Tensor) -> tuple[Tensor, Tensor]:
        """For (..., 3, Q) places the lowest of the eight cells around (..., Q) int32, and the parts of the way across.

        Those are (..., 3, Q).
        """
        cells = torch.minimum(((places - self.corner) / self.cell).clamp_(min=0), self._last - 1e-3)
        low = cells.floor()
        x, y, z = low.to(torch.int32).unbind(-2)
        return (x * self.shape[1] + y) * self.shape[2] + z, cells - low


def densities(points: Tensor) -> list[Density]:
    """The densities of a cloud (N, 3) at the BANDWIDTHS; too fine ones are replaced by the last that is not."""
    ladder: list[Density] = []
    for bandwidth in BANDWIDTHS:
        density = Density(points, bandwidth)
        if ladder and density.crowd < CROWD:
            return ladder + ladder[-1:] * (len(BANDWIDTHS) - len(ladder))
        ladder.append(density)
    return ladder


def _blurred(cells: Tensor) -> Tensor:
    """(X, Y, Z) cells blurred by (1, 2, 1) / 4 along each axis; nothing comes from outside."""
    for axis, size in enumerate(cells.shape):
        blurred = cells * 0.5
        blurred.narrow(axis, 0, size - 1).add_(cells.narrow(axis, 1, size - 1), alpha=0.25)
        blurred.narrow(axis, 1, size - 1).add_(cells.narrow(axis, 0, size - 1), alpha=0.25)
        cells = blurred
    return cells
