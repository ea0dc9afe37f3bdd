"""M4 steps 3 and 4: mirror planes by maximum likelihood: the mirrored points as a sample of the cloud's own density.

If a cloud is a sample of a symmetric surface, noise and all, so is its mirror image, and no plane makes the mirrored
points likelier than the true one, whatever the noise. The log-likelihood is smooth, so that planes ascend it from
several degrees away; how far it stays below that of the points themselves tells symmetric from not.
"""

from functools import cache

import torch
from torch import Tensor

from symshrec.methods.fit.coupling import Relations, find_relations
from symshrec.methods.fit.density import Density
from symshrec.methods.fit.steps import columns, mirror_images, stepped, tangents

FLOOR = 0.05  # of the mean density, added to it: what a point without any counterpart counts
DAMPING = 0.01  # of a step, relative to the best determined direction
NOTHING = 1e-6  # information that counts as none: every point is mirrored to where nothing is
WORSE = 1e-4  # a loss of log-likelihood a point that is rounding
RELATION_DEG, RELATION_DISTANCE = 4.0, 0.04  # within which an image of a plane in another is a third


def divergence(density: Density, points: Tensor, normals: Tensor, offsets: Tensor) -> Tensor:
    """How much denser the cloud is around points (Q, 3) of it than around their K mirror images: mean log-ratios (K,).

    They estimate the Kullback–Leibler divergence of the mirrored density from the density: about 0 for a symmetry,
    whatever the noise.
    """
    floor = FLOOR * density.mean
    own = (density.of_others(points) + floor).log()
    return (own - (density.at(mirror_images(columns(points), normals, offsets)) + floor).log()).mean(1)


def ascended(
    density: Density, points: Tensor, normals: Tensor, offsets: Tensor, steps: int, longest: float,
    tied: Tensor | None = None,
) -> tuple[Tensor, Tensor]:  # fmt: skip
    """Planes (K, 3), (K,) after steps of Fisher's scoring up the log-likelihood of the mirrored points (Q, 3).

    The information is the scores' second moment at points scattered by the density's bandwidth, since the points
    themselves, on the ridge of the density, have none. A step that lost likelihood is taken back and shortened, but for
    the last.

    Args:
        longest: step, in radians and in units of the cloud's size.
        tied: (K,) bool, planes that their relations tie together; none by default.
    """
    floor = FLOOR * density.mean
    points = columns(points)
    scatter = density.bandwidth * _scatter(points.shape[1]).to(points.device)
    best: tuple[Tensor, ...] | None = None
    share = torch.ones_like(offsets)
    for _ in range(steps):
        basis = tangents(normals)
        places = mirror_images(points, normals, offsets)
        values, scores = _scores(density, points, normals, offsets, basis, places, floor)
        now: tuple[Tensor, ...] = (normals, offsets, basis, values.log().mean(1), scores.sum(2))
        if best is None:
            _, scattered = _scores(density, points, normals, offsets, basis, places + scatter, floor)
            information = scattered @ scattered.mT
            damping = DAMPING * information.diagonal(dim1=1, dim2=2).amax(1).clamp_min(NOTHING)
            information = information + torch.diag_embed(damping[:, None].expand(-1, 3))
        else:
            lost = now[3] < best[3] - WORSE
            now = tuple(
                torch.where(lost.reshape(-1, *[1] * (new.dim() - 1)), old, new)
                for old, new in zip(best, now, strict=True)
            )
            share = torch.where(lost, share / 4, (share * 2).clamp_max(1.0))
        best = now
        normals, offsets, basis, _, slopes = now
        relations = _relations(normals, offsets, tied)
        normals, offsets = stepped(normals, offsets, basis, information, slopes * share[:, None], longest, relations)
    return normals, offsets


def _scores(density, points, normals, offsets, basis, places, floor: float) -> tuple[Tensor, Tensor]:
    """Likelihoods (K, Q) of points (3, Q) mirrored to `places` (K, 3, Q), and slopes of their logarithms (K, 3, Q)."""
    values, slopes = density.with_slope(places)
    values = values + floor
    frames = torch.cat([normals[:, None], basis], 1)  # (K, 3, 3): the normal, then the tangents
    pulls = frames @ (slopes / values[:, None])
    heights = frames @ points
    heights[:, 0] -= offsets[:, None]
    turns = torch.addcmul(heights[:, 1:] * pulls[:, :1], heights[:, :1], pulls[:, 1:])
    return values, torch.cat([-2 * turns, 2 * pulls[:, :1]], 1)


def _relations(normals: Tensor, offsets: Tensor, tied: Tensor | None) -> Relations | None:
    if tied is None:
        return None
    return find_relations(normals, offsets, RELATION_DEG, RELATION_DISTANCE).among(tied)


@cache
def _scatter(count: int) -> Tensor:
    """(3, count) normal numbers, always the same."""
    return columns(torch.randn(count, 3, generator=torch.Generator().manual_seed(0)))
