"""M4 step 4, last part: planes sharpened on local planes that the symmetry itself has made denser."""

import torch
from torch import Tensor

from symshrec.methods.refine.alignment import Pairs, mirrored, mirrored_nearest, moved
from symshrec.methods.refine.coupling import Relations
from symshrec.methods.refine.ends import with_ends
from symshrec.methods.refine.surface import Surface, symmetrised

MOST_MIRRORS = 6  # planes whose images are added to the local planes
NEIGHBOURS = 6  # from each image
SURFACE_SCALES = (0.02, 0.01, 0.005, 0.0025, 0.0015)
SCALES = (0.0035, 0.002, 0.0015)
DAMPING = 1e-6


def sharpened(
    surface: Surface, normals: Tensor, offsets: Tensor, relations: Relations | None, rounds: int
) -> tuple[Tensor, Tensor]:
    """Symmetries (K, 3), (K,), the surest first, known to about 1°, to a tenth of that where points are exact.

    Args:
        relations: that tie the planes, as for `moved`.
        rounds: of symmetrising the surface and aligning the planes.
    """
    rows = torch.arange(len(surface.points), device=normals.device)
    for _ in range(rounds):
        mirrors, places = normals[:MOST_MIRRORS], offsets[:MOST_MIRRORS]

        def back(points: Tensor, mirrors=mirrors, places=places) -> Tensor:
            heights = (points * mirrors[:, None, None]).sum(-1) - places[:, None, None]
            return points - 2 * heights[..., None] * mirrors[:, None, None]

        images = mirrored(surface.points, mirrors, places)
        denser = symmetrised(surface, images, back, NEIGHBOURS, SURFACE_SCALES)
        pairs = Pairs(denser, rows, mirrored_nearest(surface, normals, offsets, rows)[1])
        for scale in SCALES:
            normals, offsets, blind = moved(pairs, normals, offsets, scale, DAMPING, relations)
        offsets = with_ends(denser, normals, offsets, blind)
    return normals, offsets
