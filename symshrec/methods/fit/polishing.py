"""M4 step 4: the last places of planes: aligned point to plane, at the offset that the surface supports best."""

import torch
from torch import Tensor

from symshrec.methods.fit.alignment import AlignmentSettings, aligned
from symshrec.methods.fit.density import Density
from symshrec.methods.fit.judgement import Judge, Judgement
from symshrec.methods.fit.likelihood import divergence
from symshrec.methods.fit.surface import Neighbours

ENDS = 0.02  # of value, by which the offset midway between the ends of the cloud must not be worse than the one before
LOST = 0.12  # of value, by which an aligned plane must not be worse than it was before
UNLIKELIER = 0.02  # of divergence, by which an aligned plane of a noisy cloud must not be worse
SLIDE, SLIDES = 0.006, 10  # step and number of steps to either side of the offsets that are tried
MOST_SLID, WORTH, GAIN = 8, 0.3, 0.03  # planes tried; least value, of the best one's; least gain of value
INCOMPLETE = 0.93  # share seen below which something is missing, and the middle of the cloud is no guide


def polished(
    neighbours: Neighbours, judge: Judge, normals: Tensor, offsets: Tensor, value: Tensor, tied: Tensor,
    settings: AlignmentSettings, noisy: Density | None = None,
) -> tuple[Tensor, Tensor]:  # fmt: skip
    """Planes (K, 3), (K,) of values (K,) aligned on the whole cloud, but for those that lose by it.

    Where the surface is blind to an offset, the ends of the cloud tell it; where an end is missing they mislead.

    Args:
        neighbours, tied: as `aligned` takes them. judge: of the cloud.
        noisy: the finest density of a cloud whose points are all off the surface; planes that become less likely by
            the alignment, which trusts exact points, then stay where they were.
    """
    turned, surface, ends = aligned(neighbours, normals, offsets, tied, settings)
    best = judge(turned, ends).value
    if not torch.equal(surface, ends):
        other = judge(turned, surface).value
        better = other > best + ENDS
        ends, best = torch.where(better, surface, ends), torch.where(better, other, best)
    lost = value > best + LOST
    if noisy is not None:
        before, after = (divergence(noisy, judge.even, *planes) for planes in ((normals, offsets), (turned, ends)))
        lost |= after > before + UNLIKELIER
    return torch.where(lost[:, None], normals, turned), torch.where(lost, offsets, ends)


def slid(
    judge: Judge, judgement: Judgement, normals: Tensor, offsets: Tensor, free: Tensor
) -> tuple[Tensor, Tensor, Tensor]:
    """Those of the planes (K, 3), (K,) of an incomplete cloud that are supported better at another offset, there.

    Args:
        free: (K,) bool, the planes that may move.

    Returns:
        Normals, offsets and values there.
    """
    value = judgement.value
    rows = torch.nonzero(free & (judgement.seen < INCOMPLETE) & (value > WORTH * value.max()))[:MOST_SLID, 0]
    tried = offsets[rows, None] + torch.arange(-SLIDES, SLIDES + 1, device=offsets.device) * SLIDE
    values = judge(normals[rows].repeat_interleave(tried.shape[1], 0), tried.flatten()).value.reshape(tried.shape)
    best, at = values.max(1)
    better = best > value[rows] + GAIN
    return normals[rows][better], tried.gather(1, at[:, None])[:, 0][better], best[better]
