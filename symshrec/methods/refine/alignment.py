"""M4 step 4: robust point-to-plane Gauss–Newton over mirror planes, all planes of a cloud at once, in torch."""

import torch
from torch import Tensor

from symshrec.methods.refine.coupling import Relations, relation_system
from symshrec.methods.refine.surface import Surface, falling

LONGEST_STEP = 0.1  # radians, and the same share of the cloud's size
STIFFNESS = 1e4  # of the relations between planes, relative to the best determined direction of the data
DAMPING = 1e-6  # of a step, relative to the weight of the pairs
LOCK = 1e3  # the same, of an offset the surface is blind to
SLIDING = 0.03  # mean squared cosine between plane and surface normals below which the surface is blind to the offset


def mirrored(vectors: Tensor, normals: Tensor, offsets: Tensor | None = None) -> Tensor:
    """(Q, 3) points mirrored across K planes n·x = offset, (K, 3) and (K,); directions without offsets: (K, Q, 3)."""
    heights = normals @ vectors.T
    if offsets is not None:
        heights = heights - offsets[:, None]
    return vectors - 2 * heights[..., None] * normals[:, None]


def tangents(normals: Tensor) -> Tensor:
    """Two unit vectors (K, 2, 3) orthogonal to each other and to unit normals (K, 3)."""
    axes = torch.zeros_like(normals).scatter_(-1, normals.abs().argmin(-1, keepdim=True), 1.0)
    first = torch.nn.functional.normalize(torch.linalg.cross(normals, axes), dim=-1)
    return torch.stack([first, torch.linalg.cross(normals, first)], -2)


class Pairs:
    """Points of a surface and, for each of K planes, the points that their mirror images are compared with.

    Args:
        surface: of N points.
        queries: (Q,), rows of the points that are mirrored.
        matches: (K, Q), rows of the points compared with; matched (K, Q) in [0, 1] weighs them.
    """

    def __init__(self, surface: Surface, queries: Tensor, matches: Tensor, matched: Tensor | None = None):
        self.points, self.normals = surface.anchors[queries], surface.normals[queries]
        self.targets, self.target_normals = surface.anchors[matches], surface.normals[matches]
        self.weights = surface.certainty[queries] * surface.certainty[matches]
        if matched is not None:
            self.weights = self.weights * matched

    def system(self, normals: Tensor, offsets: Tensor, basis: Tensor, scale: float) -> tuple[Tensor, Tensor, Tensor]:
        """Normal equations of one step for planes (K, 3), (K,) along tangents (K, 2, 3) and the offset.

        The residual of a pair is its distance along the sum of both normals, which is exact to third order where the
        surface is curved (Rusinkiewicz 2019). Its weight falls with the residual and with the angle of the normals.

        Returns:
            (K, 3, 3) and (K, 3) float64, and the pairs' mean weight (K,).
        """
        heights = normals @ self.points.T - offsets[:, None]  # (K, Q)
        gaps = self.points - 2 * heights[..., None] * normals[:, None] - self.targets
        image_normals = mirrored(self.normals, normals)
        cosines = (image_normals * self.target_normals).sum(-1)
        common = self.target_normals + torch.sign(cosines)[..., None] * image_normals
        common = torch.nn.functional.normalize(common, dim=-1)
        residuals = (gaps * common).sum(-1)
        weights = self.weights * cosines.square().square() * falling(residuals / scale)
        along = common @ normals[..., None]  # (K, Q, 1)
        slopes = self.points @ basis.mT * along + heights[..., None] * (common @ basis.mT)
        jacobian = torch.cat([slopes, -along], -1) * -2
        weighted = (jacobian * weights[..., None]).mT
        return (weighted @ jacobian).double(), (weighted @ residuals[..., None])[..., 0].double(), weights.sum(1)


def moved(
    pairs: Pairs, normals: Tensor, offsets: Tensor, scale: float, damping: float, relations: Relations | None = None
) -> tuple[Tensor, Tensor, Tensor]:
    """The planes (K, 3), (K,) after one step on the pairs, each its own, or all together where relations tie them.

    Returns:
        Normals, offsets, and whether the surface is blind to the offset (K,); where it is, the offset stays.
    """
    basis = tangents(normals)
    matrices, right, total = pairs.system(normals, offsets, basis, scale)
    total = total.double().clamp_min(1e-6)
    blind = matrices[:, 2, 2] < 4 * SLIDING * total
    stiffness = STIFFNESS * matrices.diagonal(dim1=-2, dim2=-1).max().clamp_min(1e-6)
    ridge = (damping * total)[:, None].repeat(1, 3)
    ridge[:, 2] += torch.where(blind, LOCK * total, 0.0)
    matrices = matrices + torch.diag_embed(ridge)
    if relations is None or not len(relations.mirror):
        steps = -torch.linalg.solve(matrices, right)
    else:
        tied, tied_right = relation_system(relations, normals, offsets, basis)
        whole = torch.block_diag(*matrices) + stiffness * tied
        steps = -torch.linalg.solve(whole, right.flatten() + stiffness * tied_right).reshape(-1, 3)
    steps = (steps * (LONGEST_STEP / steps.norm(dim=-1, keepdim=True).clamp_min(LONGEST_STEP))).to(normals.dtype)
    turned = normals + (steps[:, :2, None] * basis).sum(1)
    return torch.nn.functional.normalize(turned, dim=-1), offsets + steps[:, 2], blind


def mirrored_nearest(surface: Surface, normals: Tensor, offsets: Tensor, queries: Tensor) -> tuple[Tensor, Tensor]:
    """Distances and rows (K, Q) of the points nearest the mirror images of points `queries` (Q,) in K planes."""
    distances, nearest = surface.neighbours.query(mirrored(surface.points[queries], normals, offsets), 1)
    return distances[..., 0], nearest[..., 0]


def align(
    surface: Surface, normals: Tensor, offsets: Tensor, queries: Tensor, scales: tuple[float, ...],
    steps: int = 2, relations: Relations | None = None,
) -> tuple[Tensor, Tensor, Tensor]:  # fmt: skip
    """Planes (K, 3), (K,) refined on the mirrored points `queries` (Q,): at each scale one search of nearest points.

    Returns:
        As `moved`.
    """
    for scale in scales:
        _, matches = mirrored_nearest(surface, normals, offsets, queries)
        pairs = Pairs(surface, queries, matches)
        for _ in range(steps):
            normals, offsets, blind = moved(pairs, normals, offsets, scale, DAMPING, relations)
    return normals, offsets, blind
