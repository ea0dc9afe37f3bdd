"""M4 step 5: confidences from divergences, by a logistic regression that training shapes have calibrated."""

import torch
from torch import Tensor

FEWEST = 256  # points of the sparsest clouds calibrated on; fewer count as so many
NAMES = ("divergence", "excess", "sparseness")  # of the features, after the intercept


def features(divergences: Tensor, count: int) -> Tensor:
    """What a plane's confidence depends on: (K, 3) float64.

    Args:
        divergences: (K,), of the planes of one cloud. count: its points.

    Returns:
        The divergence; how far it is above that of the cloud's best plane; and 1 / √count, since chance alone makes
        the mirror image of a sparse cloud fit it less well.
    """
    divergences = divergences.double()
    return torch.stack(
        [divergences, divergences - divergences.min(), torch.full_like(divergences, max(count, FEWEST) ** -0.5)], dim=1
    )


def confidences(divergences: Tensor, count: int, calibration: tuple[float, ...]) -> Tensor:
    """How likely each of the K planes is a symmetry, (K,) float64 in (0, 1).

    Args:
        calibration: the intercept, then the weights of the `features`.
    """
    intercept, *others = calibration
    weights = torch.tensor(others, dtype=torch.float64, device=divergences.device)
    return torch.sigmoid(intercept + features(divergences, count) @ weights)
