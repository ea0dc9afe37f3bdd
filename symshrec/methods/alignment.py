"""M4 step 4: robust point-to-plane Gauss–Newton over mirror planes, all planes of a cloud at once, in torch."""

import torch
from torch import Tensor

from symshrec.methods.surface import Surface


def tangents(normals: Tensor) -> Tensor:
    """Two unit vectors (K, 2, 3) that are orthogonal to each other and to the unit normals (K, 3)."""
    axis = torch.zeros_like(normals).scatter_(-1, normals.abs().argmin(-1, keepdim=True), 1.0)
    first = torch.linalg.cross(normals, axis)
    first = first / first.norm(dim=-1, keepdim=True)
    return torch.stack([first, torch.linalg.cross(normals, first)], -2)


def mirrored(vectors: Tensor, normals: Tensor, offsets: Tensor | float = 0.0) -> Tensor:
    """(Q, 3) points mirrored across K planes n·x = offset: (K, Q, 3)."""
    heights = normals @ vectors.T - (offsets[:, None] if isinstance(offsets, Tensor) else offsets)
    return vectors - 2 * heights[..., None] * normals[:, None]


def step(points, normals_of, certainty, targets, target_normals, target_certainty, normals, offsets, scale, damping=1e-6):
    """One Gauss–Newton step. points (Q, 3); targets (K, Q, 3); planes normals (K, 3), offsets (K,)."""
    heights = points @ normals.T - offsets  # (Q, K)
    heights = heights.T
    images = points - 2 * heights[..., None] * normals[:, None]
    image_normals = mirrored(normals_of, normals)
    cosine = (image_normals * target_normals).sum(-1)
    common = target_normals + torch.sign(cosine)[..., None] * image_normals
    common = common / common.norm(dim=-1, keepdim=True).clamp_min(1e-12)
    residual = ((images - targets) * common).sum(-1)
    weights = certainty * target_certainty * cosine.square().square()
    weights = weights * (1 + (residual / scale).square()).square().reciprocal()
    along = (common * normals[:, None]).sum(-1)  # (K, Q)
    basis = tangents(normals)  # (K, 2, 3)
    sides = points @ basis.mT  # (K, Q, 2)
    slopes = common @ basis.mT
    jacobian = torch.cat([sides * along[..., None] + heights[..., None] * slopes, -along[..., None]], -1) * -2
    weighted = (jacobian * weights[..., None]).mT
    system = (weighted @ jacobian).double()
    right = (weighted @ residual[..., None])[..., 0].double()
    ridge = damping * weights.sum(1).double().clamp_min(1e-12)
    system = system + ridge[:, None, None] * torch.eye(3, dtype=torch.float64, device=points.device)
    move = -torch.linalg.solve(system, right[..., None])[..., 0].to(points.dtype)
    return move, basis, weights, residual, system


def moved(normals, offsets, move, basis, limit=0.1):
    """Planes after a step, no further than `limit` (radians, and the same share of the scale)."""
    move = move * (limit / move.norm(dim=-1, keepdim=True).clamp_min(limit))
    turned = normals + (move[:, :2, None] * basis).sum(1)
    return turned / turned.norm(dim=-1, keepdim=True), offsets + move[:, 2]


def align(surface: Surface, normals, offsets, queries: Tensor, scales, inner=2):
    """Refine against nearest neighbours: one look-up per scale, `inner` steps each. queries: indices (Q,)."""
    points, normals_of, certainty = surface.anchors[queries], surface.normals[queries], surface.weights[queries]
    for scale in scales:
        images = mirrored(points, normals, offsets)
        nearest = surface.neighbours.query(images, 1)[..., 0]
        targets, target_normals, target_certainty = (
            surface.anchors[nearest], surface.normals[nearest], surface.weights[nearest])
        for _ in range(inner):
            move, basis, weights, residual, system = step(
                points, normals_of, certainty, targets, target_normals, target_certainty, normals, offsets, scale)
            normals, offsets = moved(normals, offsets, move, basis)
    return normals, offsets, system
