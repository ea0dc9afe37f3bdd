"""M4 step 5: how far a mirrored cloud is from the cloud, in units of how far the cloud's points are from each other."""

from torch import Tensor

from symshrec.methods.alignment import mirrored
from symshrec.methods.surface import Surface

FAR = 0.1  # of the cloud's size: a point without a counterpart is at most this far from one


def misfit(surface: Surface, normals: Tensor, offsets: Tensor, queries: Tensor) -> Tensor:
    """Logarithm of the mean distance from mirrored points to the nearest point, over that from the points themselves.

    If the cloud is a sample of a symmetric surface, noise and all, its mirror image is another sample of it, and the
    ratio is 1 but for chance, whatever the noise and the density. About 0 for a symmetry, 0.25 and more for none.

    Args:
        normals, offsets: K planes. queries: (Q,), rows of the points to mirror.

    Returns:
        (K,).
    """
    distances, _ = surface.neighbours.query(mirrored(surface.points[queries], normals, offsets), 1)
    own = surface.spacing[queries].clamp(1e-9, FAR).mean()
    return (distances[..., 0].clamp_max(FAR).mean(1) / own).log()
