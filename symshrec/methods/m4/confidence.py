"""M4 step 5: confidences from what speaks for and against a plane, by logistic regressions on training shapes."""

from math import log

import torch
from torch import Tensor

from symshrec.methods.fit.evening import EVEN
from symshrec.methods.fit.judgement import Judgement

FEWEST = 256  # points of the sparsest clouds calibrated on; fewer count as so many
NAMES = ("divergence", "excess", "sparseness")  # of the features, after the intercept
# The same, of planes that are judged by surface.
SURFACE_NAMES = (
    *("by density", "misfit", "excess", "coarseness", "thickness", "blur", "behind", "extent"),
    *("unevenness", "sure", "sure by density", "sure misfit", "sure unevenness"),
)
SURE = 4.0  # logit by density beyond which more tells no more
HOPELESS = -12.0  # and below which
ROOM = 0.05  # misfit = log(1 + ROOM − `Judgement.strict`)
MOST_UNEVEN = 0.6  # above that of an even sample, beyond which more tells no more
MOST_EXCESS, MOST_BEHIND = 0.3, 0.6  # beyond which more tells no more, since what is missing costs as much
THIN, MOST_THICK = 0.4, 2.0  # count · spacing² of a surface at most; the most of its logarithm above that
LEAST, MOST = -0.05, 0.3  # nats, between which a divergence tells


def features(divergences: Tensor, count: int) -> Tensor:
    """What the confidence of a plane depends on in an even sample of a whole object: (K, 3) float64.

    Args:
        divergences: (K,), of the planes of one cloud. count: its points.

    Returns:
        The divergence; how far it is above that of the cloud's best plane; and 1 / √count, since chance alone makes
        the mirror image of a sparse cloud fit it less well.
    """
    own = divergences.double()
    return torch.stack([own, own - own.min(), torch.full_like(own, max(count, FEWEST) ** -0.5)], dim=1)


def surface_features(
    by_density: Tensor, divergences: Tensor, judgement: Judgement, count: int, spacing: float,
    uneven: float, sure: bool,
) -> Tensor:  # fmt: skip
    """What it depends on where the sample is uneven or parts of the object are missing: (K, 13) float64.

    Args:
        by_density: (K,), logits by the other regression. divergences: (K,), in the evened cloud, about 0 for a
            symmetry. judgement: of the planes. count, spacing: of the evened cloud.
        uneven: how far the cloud's density differs from place to place (see `unevenness`).
        sure: whether a plane of the cloud is sure by density.

    Returns:
        In the order of SURFACE_NAMES: the logit, cut off at both ends; misfit, how much surface has no mirror image,
        what contradicts the symmetry weighing far more than what is missing; excess, how far the divergence is above
        that of the cloud's best plane; coarseness, the logarithm of the spacing, within which every image counts as
        supported, so that chance supports planes of sparse clouds; thickness, how far the evened points fill more than
        a surface, as noise and volumes do, whose planes support does not tell apart; blur, the divergence, which does,
        times the thickness; behind, how much less surface has a mirror image than in the cloud's best plane; extent,
        the share of the points that the plane moves; unevenness, above that of an even sample; and, where some plane
        is sure by density, that it is, with three of the others: an even sample then has no further planes, and an
        uneven one may.
    """
    divergences = divergences.double()
    value = judgement.strict
    one = torch.ones_like(divergences)
    logit, misfit = by_density.double().clamp(HOPELESS, SURE), (1 + ROOM - value).log()
    above = one * min(max(uneven - EVEN, 0.0), MOST_UNEVEN)
    thickness = one * min(max(log(count * spacing**2 / THIN), 0.0), MOST_THICK)
    return torch.stack(
        [
            logit,
            misfit,
            (divergences - divergences.min()).clamp_max(MOST_EXCESS),
            one * log(spacing),
            thickness,
            divergences.clamp(LEAST, MOST) * thickness,
            (value.max() - value).clamp_max(MOST_BEHIND),
            judgement.moved.double(),
            above,
            *(sure * each for each in (one, logit, misfit, above)),
        ],
        dim=1,
    )


def logits(table: Tensor, calibration: tuple[float, ...]) -> Tensor:
    """The log-odds (K,) float64 that planes of features (K, F) are symmetries.

    Args:
        calibration: the intercept, then the weights of the features.
    """
    intercept, *weights = calibration
    return intercept + table @ torch.tensor(weights, dtype=torch.float64, device=table.device)


def confidences(divergences: Tensor, count: int, calibration: tuple[float, ...]) -> Tensor:
    """How likely each of the K planes of an even sample is a symmetry, (K,) float64 in (0, 1).

    Args:
        calibration: the intercept, then the weights of the `features`.
    """
    return torch.sigmoid(logits(features(divergences, count), calibration))
