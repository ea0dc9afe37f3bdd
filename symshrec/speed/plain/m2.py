"""§3.2 M2's loss and cleaning line by line as the paper words them, without the shortcuts of `methods.m2`."""

import numpy as np
import torch
from torch import Tensor


def mirrored_chamfer(points: Tensor, normals: Tensor, offsets: Tensor) -> Tensor:
    """D(P, P′) of one cloud (N, 3) and its mirror images in the planes n·x + d = 0, (H, 3) and (H,): (H,)."""
    distances = []
    for normal, offset in zip(normals, offsets, strict=True):
        mirrored = points - 2 * (points @ normal + offset)[:, None] * normal
        squares = torch.cdist(points, mirrored, compute_mode="donot_use_mm_for_euclid_dist") ** 2
        distances.append(squares.min(1).values.sum() + squares.min(0).values.sum())
    return torch.stack(distances)


def symmetry_loss(points: Tensor, normals: Tensor, offsets: Tensor, weight: float = 17.0) -> Tensor:
    """L = Ls + w_r L_r of one cloud."""
    regularisation = (normals @ normals.T - torch.eye(len(normals), dtype=normals.dtype)).norm() ** 2
    return mirrored_chamfer(points, normals, offsets).sum() + weight * regularisation


def clean(normals: np.ndarray, losses: np.ndarray, merge_rad=np.pi / 10, mean_factor=1.35, loss_limit=7.0) -> list[int]:
    """The planes left of unit normals (H, 3) with symmetry losses (H,), by ascending loss."""
    # "all planes whose normal's angles were within π/10 radians were considered to be the same plane and only the one
    # with the smallest symmetry loss was kept"
    merged = []
    for plane in sorted(range(len(losses)), key=lambda each: losses[each]):
        angles = [np.arccos(min(1.0, abs(normals[plane] @ normals[other]))) for other in merged]
        if all(angle > merge_rad for angle in angles):
            merged.append(plane)
    # "all planes whose symmetry loss was both (i) not within 1.35 times the average loss of the remaining planes, and
    # (ii) larger than a threshold value (7 worked well ...) were also removed"
    kept = []
    for plane in merged:
        average = sum(losses[other] for other in merged) / len(merged)
        if losses[plane] <= mean_factor * average or losses[plane] <= loss_limit:
            kept.append(plane)
    return kept
