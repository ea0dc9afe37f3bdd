"""M4 steps 3 and 4: mirroring, and one least-squares step of all planes of a cloud, tied by their relations."""

import torch
from torch import Tensor

from symshrec.methods.fit.coupling import Relations, relation_system

STIFFNESS = 1e4  # of the relations between planes, relative to the best determined direction of the data


def mirrored(points: Tensor, normals: Tensor, offsets: Tensor) -> Tensor:
    """(Q, 3) points mirrored across K planes n·x = offset, (K, 3) and (K,): (K, Q, 3)."""
    heights = normals @ points.T - offsets[:, None]
    return points - 2 * heights[..., None] * normals[:, None]


def columns(points: Tensor) -> Tensor:
    """Points (Q, 3) as columns (3, Q), on which arithmetic is faster: one coordinate of all is contiguous."""
    return points.T.contiguous()


def mirror_images(points: Tensor, normals: Tensor, offsets: Tensor) -> Tensor:
    """As `mirrored`, of columns: (3, Q) points mirrored across K planes n·x = offset, (K, 3) and (K,): (K, 3, Q)."""
    heights = torch.addmm(offsets[:, None], normals, points, beta=-1)
    return torch.addcmul(points, heights[:, None], normals[..., None], value=-2.0)


def tangents(normals: Tensor) -> Tensor:
    """Two unit vectors (K, 2, 3) orthogonal to each other and to unit normals (K, 3)."""
    axes = torch.zeros_like(normals).scatter_(-1, normals.abs().argmin(-1, keepdim=True), 1.0)
    first = torch.nn.functional.normalize(torch.linalg.cross(normals, axes), dim=-1)
    return torch.stack([first, torch.linalg.cross(normals, first)], -2)


def stepped(
    normals: Tensor, offsets: Tensor, basis: Tensor, matrices: Tensor, right: Tensor,
    longest: float, relations: Relations | None = None,
) -> tuple[Tensor, Tensor]:  # fmt: skip
    """Planes (K, 3), (K,) after the steps that solve matrices · step = right, (K, 3, 3) and (K, 3).

    Args:
        basis: tangents (K, 2, 3); a step's three numbers are along them, in radians, and along the offset.
        longest: of a plane's step.
        relations: that tie the planes, all solved for at once; without any, each plane is on its own.
    """
    if relations is None or not len(relations.mirror):
        steps = torch.linalg.solve(matrices, right)
    else:
        stiffness = STIFFNESS * matrices.diagonal(dim1=-2, dim2=-1)[:, :2].max().double().clamp_min(1e-9)
        tied, off = relation_system(relations, normals, offsets, basis)
        whole = torch.block_diag(*matrices.double()) + stiffness * tied
        steps = torch.linalg.solve(whole, right.double().flatten() - stiffness * off).reshape(-1, 3)
    steps = (steps * (longest / steps.norm(dim=-1, keepdim=True).clamp_min(longest))).to(normals.dtype)
    turned = normals + (steps[:, :2, None] * basis).sum(1)
    return torch.nn.functional.normalize(turned, dim=-1), offsets + steps[:, 2]
