"""M4 step 4: robust point-to-plane least squares, on local planes that the symmetry itself has made denser.

Under noise a share of the points is still exact. A local plane fitted to a point's neighbours and to the mirrored ones,
which are further samples of the same surface, tells the exact from the noisy; the planes of symmetry then move so that
the mirrored exact points lie in the local planes. Local planes go through the points themselves and not through the
mirrored ones, which makes the step blind to where the planes of symmetry were.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from symshrec.methods.fit.coupling import find_relations
from symshrec.methods.fit.ends import end_offset, near_ends
from symshrec.methods.fit.steps import columns, mirrored, stepped, tangents
from symshrec.methods.fit.surface import Neighbours, falling, local_planes

SURFACE_SCALES = (0.02, 0.008, 0.003)  # of the local planes, shares of the cloud's size like all lengths here
MOST_MIRRORS = 6  # planes whose mirrored points are added to the local planes
MATCHES = 4  # nearest points to a mirrored one
FIRST_POINTS = 1000  # mirrored in the first round, when the matches are not yet final
SCALES = ((0.005, 0.0035, 0.0025), (0.0025, 0.0015, 0.0015))  # of the residuals, in the first round and in the others
RELATION_DEG, RELATION_DISTANCE = 2.0, 0.04
LONGEST_STEP = 0.05
CONVERGED = 2e-4  # the largest move in a round after which no other is worth its time
DAMPING = 1e-6  # of a step, relative to the weight of the pairs
LOCK = 1e3  # the same, of an offset the surface is blind to
SLIDING = 0.03  # mean squared cosine between plane and surface normals below which the surface is blind to the offset


@dataclass(frozen=True)
class AlignmentSettings:
    """points: mirrored in each plane. neighbours: points in a local plane. rounds: at most; 0 leaves planes alone."""

    points: int = 2000
    neighbours: int = 12
    rounds: int = 10


def aligned(
    neighbours: Neighbours, normals: Tensor, offsets: Tensor, tied: Tensor, settings: AlignmentSettings
) -> tuple[Tensor, Tensor, Tensor]:
    """Symmetries (K, 3), (K,) of a cloud (N, 3), known to about 1°, to a tenth of that where points are exact.

    Args:
        neighbours: in the cloud, which is in the frame of `frame_of`, any prefix of it being a random sample.
        normals, offsets: the surest first, whose mirrored points make the local planes denser.
        tied: (K,) bool, the sure ones, which their relations tie together, and which must have come to rest.

    Returns:
        Normals, offsets, and the same offsets but that those which the surface is blind to are midway between the ends.
    """
    cloud = neighbours.points
    relations = find_relations(normals, offsets, RELATION_DEG, RELATION_DISTANCE).among(tied)
    heard = tied if tied.any() else torch.ones_like(tied)
    blind = torch.zeros_like(tied)
    everyone = cloud[: settings.points]
    nearest = neighbours.query(everyone, min(settings.neighbours, len(cloud)))
    surroundings = cloud[nearest] - everyone[:, None]
    for turn in range(settings.rounds):
        if turn < 2:
            rows = everyone[: FIRST_POINTS if turn == 0 and settings.rounds > 1 else settings.points]
            nearest = neighbours.query(mirrored(rows, normals, offsets), min(MATCHES, len(cloud)))
            matches = cloud[nearest]  # (K, M, n, 3)
        denser = _with_mirrored(rows, surroundings[: len(rows)], matches, normals, offsets)
        pairs = Pairs(rows, *local_planes(denser, SURFACE_SCALES), matches)
        before = normals, offsets
        for scale in SCALES[min(turn, 1)]:
            basis = tangents(normals)
            matrices, right, blind = pairs.system(normals, offsets, basis, scale)
            normals, offsets = stepped(normals, offsets, basis, matrices, right, LONGEST_STEP, relations)
        moved = torch.maximum((normals - before[0]).abs().amax(1), (offsets - before[1]).abs())
        if moved[heard].max() < CONVERGED:
            break
    surface, offsets = offsets, offsets.clone()
    for row in torch.nonzero(blind)[:, 0].tolist():
        offsets[row] = _middle(cloud, neighbours, normals[row], settings.neighbours).to(offsets.dtype)
    return normals, surface, offsets


def _middle(cloud: Tensor, neighbours: Neighbours, normal: Tensor, count: int) -> Tensor:
    """The offset midway between the ends of the cloud along a normal, points counting as surely as they are exact."""
    heights = cloud @ normal
    weights, near = torch.ones_like(heights), near_ends(heights)
    nearest = neighbours.query(cloud[near], min(count, len(cloud)))
    _, weights[near] = local_planes(cloud[nearest] - cloud[near][:, None], SURFACE_SCALES)
    return end_offset(heights, weights)


class Pairs:
    """Points with their local planes and, for each of K planes of symmetry, points whose images should lie in them.

    Args:
        points, normals: (M, 3). certainty: (M,), how surely a point lies on the surface. matches: (K, M, n, 3).
    """

    def __init__(self, points: Tensor, normals: Tensor, certainty: Tensor, matches: Tensor):
        self.matches = matches.permute(0, 3, 2, 1).contiguous()  # (K, 3, n, M)
        self.normals = columns(normals)
        self.certainty = certainty
        x, y, z = self.normals
        gaps = torch.addcmul(torch.addcmul(self.matches[:, 0] * x, self.matches[:, 1], y), self.matches[:, 2], z)
        self.gaps = gaps - (points * normals).sum(1)  # (K, n, M)

    def system(self, normals: Tensor, offsets: Tensor, basis: Tensor, scale: float) -> tuple[Tensor, Tensor, Tensor]:
        """Normal equations of one step for planes (K, 3), (K,) along tangents (K, 2, 3) and the offset.

        Residuals are the distances of the matches' images from the local planes; their weight falls with them.

        Returns:
            Matrices (K, 3, 3) and right sides (K, 3) float64, and whether the surface is blind to the offset (K,),
            which then stays.
        """
        frames = torch.cat([normals[:, None], basis], 1)  # (K, 3, 3): the normal, then the tangents
        heights = (frames @ self.matches.flatten(2)).reshape(self.matches.shape)  # (K, 3, n, M)
        heights[:, 0] -= offsets[:, None, None]
        cosines = (frames @ self.normals)[:, :, None]  # (K, 3, 1, M)
        height, along = heights[:, :1], cosines[:, :1]
        slopes = torch.empty(len(offsets), 4, *self.gaps.shape[1:], device=offsets.device)  # but for −2 before all
        torch.addcmul(heights[:, 1:] * along, height, cosines[:, 1:], out=slopes[:, :2])
        slopes[:, 2] = -along[:, 0]
        residuals = torch.addcmul(self.gaps, height[:, 0], along[:, 0], value=-2.0)
        torch.div(residuals, 2, out=slopes[:, 3])  # the last, −residuals, is no slope
        weights = falling(residuals / scale).mul_(self.certainty).flatten(1)
        slopes = slopes.flatten(2)
        products = 4 * ((slopes[:, :3] * weights[:, None]) @ slopes.mT).double()
        matrices, right = products[..., :3], products[..., 3]
        total = weights.sum(1).double().clamp_min(1e-6)
        blind = matrices[:, 2, 2] < 4 * SLIDING * total
        ridge = (DAMPING * total)[:, None].repeat(1, 3)
        ridge[:, 2] += torch.where(blind, LOCK * total, 0.0)
        return matrices + torch.diag_embed(ridge), right, blind


def _with_mirrored(rows: Tensor, around: Tensor, matches: Tensor, normals: Tensor, offsets: Tensor) -> Tensor:
    """Places (M, k + Jn, 3) around points (M, 3) of their own neighbours (M, k, 3) and of the matches' J images."""
    matches, normals, offsets = (each[:MOST_MIRRORS] for each in (matches, normals, offsets))
    heights = (matches * normals[:, None, None]).sum(-1) - offsets[:, None, None]
    images = matches - 2 * heights[..., None] * normals[:, None, None]
    images = images.permute(1, 0, 2, 3).flatten(1, 2)  # (M, Jn, 3)
    return torch.cat([around, images - rows[:, None]], 1)
