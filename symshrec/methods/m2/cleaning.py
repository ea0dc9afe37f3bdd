"""§3.2 The cleaning step: of the planes of all heads, one of each, and none whose symmetry loss stands out."""

import numpy as np

from symshrec.methods.m2.settings import CleaningSettings, Confidence
from symshrec.planes import axis_angles


def clean(normals: np.ndarray, losses: np.ndarray, settings: CleaningSettings | None = None) -> np.ndarray:
    """The planes that remain of one cloud.

    The paper does not say in which order planes are merged; here greedily, lowest loss first, so that a plane is merged
    into a kept one only, never along a chain. The mean is that of the planes left by merging, taken once and including
    the plane it judges: the lowest loss is never above it, so a cloud always keeps a plane.

    Args:
        normals: (H, 3), of unit length; opposite ones are equal. Offsets play no part.
        losses: (H,), Chamfer distances of the planes.
        settings: the published ones where omitted.

    Returns:
        Indices of the planes by ascending loss, int64; equal losses in their own order.

    Raises:
        ValueError: for shapes that do not fit, or values that are not finite.
    """
    settings = settings or CleaningSettings()
    normals, losses = np.asarray(normals, dtype=np.float64), np.asarray(losses, dtype=np.float64)
    if normals.shape != (len(losses), 3) or losses.ndim != 1:
        raise ValueError(f"normals {normals.shape} and losses {losses.shape} do not fit; expected (H, 3) and (H,)")
    for name, values in (("normal", normals), ("loss", losses[:, None])):
        if not np.isfinite(values).all():
            raise ValueError(f"{name} {int(np.argwhere(~np.isfinite(values))[0, 0])} is not finite")
    order = np.argsort(losses, kind="stable")
    same = axis_angles(normals[order], normals[order]) <= settings.merge_rad
    kept, taken = [], np.zeros(len(order), dtype=bool)
    for rank in range(len(order)):
        if not taken[rank]:
            kept.append(rank)
            taken |= same[rank]
    remaining = order[kept]
    if not len(remaining):
        return remaining
    limit = max(settings.mean_factor * losses[remaining].mean(), settings.loss_limit)
    return remaining[losses[remaining] <= limit]


def confidences(losses: np.ndarray, mode: Confidence, loss_limit: float) -> np.ndarray:
    """Confidences in (0, 1] of planes with the Chamfer distances `losses` (K,), see `Confidence`."""
    losses = np.asarray(losses, dtype=np.float64)
    return np.ones(len(losses)) if mode is Confidence.none else 1 / (1 + np.maximum(losses, 0) / loss_limit)
