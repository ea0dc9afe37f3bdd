"""§3.2 The loss without labels: L = Σᵢ D(P, P′ᵢ) + w ‖M Mᵀ − I‖²_F over the planes of all heads."""

from dataclasses import dataclass

import torch
from torch import Tensor

from symshrec.methods.m2.chamfer import mirrored_chamfer


@dataclass(frozen=True)
class SymmetryLoss:
    """The loss of a batch and its parts, each a mean over the B clouds.

    total (): what to minimise; symmetry (): Σᵢ D(P, P′ᵢ), in squared units of the cloud; regularisation (): before its
    weight; chamfer (B, H): the single D, by which cleaning tells true planes from others.
    """

    total: Tensor
    symmetry: Tensor
    regularisation: Tensor
    chamfer: Tensor


def symmetry_loss(
    points: Tensor,
    normals: Tensor,
    offsets: Tensor,
    weight: float,
    queries: Tensor | None = None,
    chunk_bytes: int | None = None,
) -> SymmetryLoss:
    """The published loss of clouds (B, N, 3) and planes n·x + d = 0, unit normals (B, H, 3) and offsets (B, H).

    Args:
        weight: w, of the regularisation.
        queries, chunk_bytes: see `mirrored_chamfer`, which also says what is raised.
    """
    chamfer = mirrored_chamfer(points, normals, offsets, queries, chunk_bytes)
    symmetry = chamfer.sum(1).mean()
    regularisation = orthogonality(normals).mean()
    return SymmetryLoss(symmetry + weight * regularisation, symmetry, regularisation, chamfer)


def orthogonality(normals: Tensor) -> Tensor:
    """‖M Mᵀ − I‖²_F of the unit normals (B, H, 3), rows of M: (B,).

    H > 3 vectors of R³ cannot be orthogonal: with H unit vectors ‖M Mᵀ − I‖² = ‖Mᵀ M‖² − H, which is least, H²/3 − H,
    where Mᵀ M = (H/3) I. For 27 heads that floor is 216. It is reached by nine heads on each of three axes as well as
    by normals spread over the sphere: the term keeps the heads from sharing one plane, and does not stop duplicates.
    """
    with torch.autocast(normals.device.type, enabled=False):
        moments = normals.mT @ normals  # (B, 3, 3)
        return moments.square().sum((1, 2)) - 2 * moments.diagonal(dim1=1, dim2=2).sum(1) + normals.shape[1]
