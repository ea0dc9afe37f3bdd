"""M4 steps 1 and 3: volumes around a cloud, of its density and of the nearest point, looked up without a tree."""

import torch
from torch import Tensor

OUTSIDE = -1


def density_volume(points: Tensor, half_width: float, size: int, blur: float) -> Tensor:
    """Density of (N, 3) points in a (size³,) volume over [−half_width, half_width]³, blurred by `blur` (a length).

    Returns:
        (size³,) float32 in [0, 1), ρ / (ρ + the mean of ρ at the points): it saturates, so that a crowded apex does not
        outweigh the rest. The outermost cells are 0.
    """
    cell = 2 * half_width / size
    places = (points + half_width) / cell - 0.5
    low = places.floor()
    part = places - low
    low = low.long()
    volume = torch.zeros(size**3, device=points.device)
    inside = ((low >= 0) & (low < size - 1)).all(1)
    low, part = low[inside], part[inside]
    first = (low[:, 0] * size + low[:, 1]) * size + low[:, 2]
    for corner in range(8):
        bits = [(corner >> axis) & 1 for axis in (2, 1, 0)]
        weight = torch.ones_like(part[:, 0])
        for axis, bit in enumerate(bits):
            weight = weight * (part[:, axis] if bit else 1 - part[:, axis])
        volume.index_add_(0, first + (bits[0] * size + bits[1]) * size + bits[2], weight)
    sigma = blur / cell
    reach = max(1, round(2.5 * sigma))
    kernel = torch.exp(-0.5 * (torch.arange(-reach, reach + 1, device=points.device) / sigma).square())
    grid = volume.reshape(1, 1, size, size, size)
    for axis in range(3):
        shape = [1, 1, 1, 1, 1]
        shape[2 + axis] = -1
        padding = [0, 0, 0]
        padding[axis] = reach
        grid = torch.nn.functional.conv3d(grid, (kernel / kernel.sum()).reshape(shape), padding=padding)
    at_points = look_up(grid.flatten(), points, half_width, size).mean().clamp_min(1e-12)
    grid = grid / (grid + at_points)
    grid[..., [0, -1], :, :] = 0
    grid[..., :, [0, -1], :] = 0
    grid[..., :, :, [0, -1]] = 0
    return grid.flatten()


def look_up(volume: Tensor, points: Tensor, half_width: float, size: int) -> Tensor:
    """Values of the volume's cells that hold the points (..., 3); points outside take the outermost cell."""
    cells = ((points + half_width) * (size / (2 * half_width))).clamp_(0, size - 0.5).to(torch.int32)
    return volume[(cells[..., 0] * size + cells[..., 1]) * size + cells[..., 2]]


def nearest_volume(points: Tensor, half_width: float, size: int, reach: int) -> Tensor:
    """Index of about the nearest of (N, 3) points for each cell within `reach` cells of one, else OUTSIDE: (size³,)."""
    cell = 2 * half_width / size
    own = ((points + half_width) / cell).floor().long()
    steps = torch.arange(-reach, reach + 1, device=points.device)
    stencil = torch.cartesian_prod(steps, steps, steps)
    stencil = stencil[stencil.square().sum(1) <= (reach + 0.5) ** 2]
    cells = own[:, None] + stencil  # (N, S, 3)
    centres = (cells + 0.5) * cell - half_width
    squared = (centres - points[:, None]).square().sum(-1) / cell**2
    inside = ((cells >= 0) & (cells < size)).all(-1)
    keys = (squared * 1024).long() << 32 | torch.arange(len(points), device=points.device)[:, None]
    flat = (cells[..., 0] * size + cells[..., 1]) * size + cells[..., 2]
    empty = torch.iinfo(torch.int64).max
    volume = torch.full((size**3,), empty, dtype=torch.int64, device=points.device)
    volume.scatter_reduce_(0, flat[inside], keys[inside], "amin")
    return torch.where(volume == empty, OUTSIDE, volume & 0xFFFFFFFF)
