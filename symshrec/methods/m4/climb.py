"""M4 steps 2 and 3: what both searches share, a climb from coarse to fine and the images of planes in each other.

Lengths are shares of the cloud's size (see `frame_of`).
"""

from collections.abc import Callable

import torch
from torch import Tensor

from symshrec.methods.fit.coupling import closure
from symshrec.methods.fit.density import Density
from symshrec.methods.fit.likelihood import ascended
from symshrec.methods.m4.settings import M4Settings

COARSE_POINTS, COARSE_STEPS, COARSE_STEP = 200, 2, 0.12
MIDDLE_POINTS, MIDDLE_STEPS = 800, 4
FINE_POINTS, FINE_STEPS = 1500, 3
LONGEST_STEP = 0.05
CLOSURES = 2  # times that images are looked for

Scored = tuple[Tensor, Tensor, Tensor]  # normals (K, 3), offsets (K,) and what ranks them (K,)


def climbed(ladder: list[Density], points: Tensor, normals: Tensor, offsets: Tensor) -> tuple[Tensor, Tensor]:
    """Candidates (K, 3), (K,) after their ascent through the three coarse densities of a cloud."""
    wide, search, coarse, *_ = ladder
    for density in (wide, search, coarse):
        normals, offsets = ascended(density, points[:COARSE_POINTS], normals, offsets, COARSE_STEPS, COARSE_STEP)
    return normals, offsets


def completed(
    found: Scored, likely: Callable[[Tensor], Tensor], kept: Callable[[Tensor, Tensor], Scored],
    ladder: list[Density], points: Tensor, settings: M4Settings,
) -> Scored:  # fmt: skip
    """The planes found and the images of the likely ones in each other that are not among them.

    Args:
        likely: scores → which planes are. kept: normals, offsets → those worth going on with, scored.
        ladder: the densities of the cloud, whose points (N, 3) these are.
    """
    _, _, coarse, middle, _ = ladder
    for _ in range(CLOSURES):
        normals, offsets, scores = found
        rows = likely(scores)
        images, places = closure(normals[rows], offsets[rows], settings.separation_deg, settings.max_planes)
        if not len(images):
            break
        for density in (coarse, middle):
            images, places = ascended(density, points[:MIDDLE_POINTS], images, places, COARSE_STEPS, LONGEST_STEP)
        found = kept(torch.cat([normals, images]), torch.cat([offsets, places]))
    return found
