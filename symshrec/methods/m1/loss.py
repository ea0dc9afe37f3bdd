"""§3.1, Eq. 1–4 and SymmetryNet's reflection loss, with one optimal assignment of heads to true planes per cloud."""

import torch
import torch.nn.functional as F
from scipy.optimize import linear_sum_assignment
from torch import Tensor

from symshrec.methods.m1.network import Dense
from symshrec.methods.m1.settings import LossSettings, VectorForm

SHORTEST = 1e-3  # offsets are not divided by less, in unit-sphere units


def m1_losses(
    dense: Dense, points: Tensor, normals: Tensor, counts: Tensor, centres: Tensor, settings: LossSettings
) -> dict[str, Tensor]:
    """The terms of the loss and their weighted sum, each a mean over points and clouds.

    A cloud without true planes has no vector, reflection and centre terms; of one with more planes than heads, those
    that fit best are matched.

    Args:
        dense: predictions of S points with M heads.
        points: (B, S, 3) those points, on the unit sphere.
        normals: (B, K, 3) true unit normals, zero beyond a cloud's own; counts: (B,) how many are its own.
        centres: (B, 3) a point on all true planes of a cloud; whatever where there is none.
        settings: weights and forms.

    Returns:
        confidence (Eq. 2), vector (Eq. 3), centre (Eq. 4), reflection and foot where they count, and `loss`.
    """
    known = (counts > 0).float()
    charges = _charges(dense, points, normals, centres, settings)  # (B, M, K) each
    with torch.no_grad():
        cost = sum(getattr(settings, name) * charge for name, charge in charges.items())
        cost = cost - settings.match_confidence * dense.logits.sigmoid().mean(1)[..., None]
        heads, matched = assignment(cost, counts)
    shares = heads / heads.sum(1, keepdim=True).clamp_min(1)  # (B, M), one over the number matched
    terms = {
        name: _mean_over_known((charge.gather(2, matched[..., None])[..., 0] * shares).sum(1), known)
        for name, charge in charges.items()
    }
    labels = heads[:, None].expand_as(dense.logits)
    terms["confidence"] = F.binary_cross_entropy_with_logits(dense.logits, labels)
    distances = (dense.centres - centres[:, None]).norm(dim=-1).mean(1)
    terms["centre"] = _mean_over_known(torch.where(counts > 0, distances, 0.0), known)
    terms["loss"] = sum(getattr(settings, name) * term for name, term in terms.items())
    return terms


def assignment(cost: Tensor, counts: Tensor) -> tuple[Tensor, Tensor]:
    """The cheapest one-to-one assignment of every cloud's heads to its true planes.

    Args:
        cost: (B, M, K). counts: (B,), true planes of each cloud, at most K.

    Returns:
        heads (B, M) float: 1 where a head has a plane, the K-hot label of Eq. 2; matched (B, M) int64: its plane.
    """
    heads = torch.zeros(cost.shape[:2])
    matched = torch.zeros(cost.shape[:2], dtype=torch.int64)
    for row, (costs, count) in enumerate(zip(cost.cpu().numpy(), counts.tolist(), strict=True)):
        chosen, planes = linear_sum_assignment(costs[:, :count])
        heads[row, chosen] = 1.0
        matched[row, chosen] = torch.from_numpy(planes)
    return heads.to(cost.device), matched.to(cost.device)


def _charges(
    dense: Dense, points: Tensor, normals: Tensor, centres: Tensor, settings: LossSettings
) -> dict[str, Tensor]:
    """For every head and true plane, the point-averaged terms that count: (B, M, K) each."""
    charges = {}
    if settings.vector:
        cosines = torch.einsum("bsmi,bki->bsmk", dense.normals, normals)
        squared = (1 - cosines.square()).clamp_min(0)
        charges["vector"] = (squared if settings.form is VectorForm.squared else (squared + 1e-6).sqrt()).mean(1)
    if settings.reflection or settings.foot:
        reflection, foot = _reflection(dense.vectors, points, normals, centres)
        charges |= {"reflection": reflection} if settings.reflection else {}
        charges |= {"foot": foot} if settings.foot else {}
    return charges


def _reflection(vectors: Tensor, points: Tensor, normals: Tensor, centres: Tensor) -> tuple[Tensor, Tensor]:
    """Two charges, (B, M, K) each, for vectors that lead from every point to its foot on the plane.

    SymmetryNet's reflection loss (Shi et al. 2020) is the distance of the mirrored point they give from the true one,
    relative to their own length; long vectors lower it, which it cannot prevent. The second, ours, is the plain
    distance of the foot point from the true one.
    """
    heights = torch.einsum("bsi,bki->bsk", points - centres[:, None], normals)  # signed distances to the true planes
    along = torch.einsum("bsmi,bki->bsmk", vectors, normals)
    lengths = vectors.norm(dim=-1, keepdim=True)  # (B, S, M, 1)
    # |vector − true|² with true = −height · normal, without a tensor over (B, S, M, K, 3)
    squared = lengths.square() + 2 * along * heights[:, :, None] + heights.square()[:, :, None]
    gaps = (squared.clamp_min(0) + 1e-12).sqrt()
    return (gaps / lengths.clamp_min(SHORTEST)).mean(1), gaps.mean(1)


def _mean_over_known(values: Tensor, known: Tensor) -> Tensor:
    return (values * known).sum() / known.sum().clamp_min(1)
