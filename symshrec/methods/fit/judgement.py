"""M4 step 5: how much of a cloud's surface a plane mirrors onto surface, and how much into the empty.

A point's mirror image is supported where the cloud lies around it, within the cloud's own spacing. Images without
support are unobserved if they continue the surface beyond an edge of it, such as a cut, a hole or the end of what a
camera sees; and they contradict the symmetry if they hover before or behind surface that was observed. The images next
to the cloud tell which, for those further off as well. A point which the plane hardly moves says nothing.
"""

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from symshrec.methods.fit.evening import evened
from symshrec.methods.fit.frame import frame_of
from symshrec.methods.fit.steps import mirrored
from symshrec.methods.fit.surface import Neighbours
from symshrec.planes import Planes

JUDGES = 600  # points of the evened cloud that are mirrored
MOVED = 2.0  # spacings that a point moves by, at least, for its image to count
LOOSE, COARSEST = 1.1, 3.0  # an image is supported within so many times the nearest point's own spacing, and at most
CLEAR = 2.0  # times as far away it is not; between the two it tells nothing
TOUCHING = 6.0  # spacings within which images without support are next to the cloud
EDGE_REACH, FEW = 2.5, 24  # spacings around a point, and most neighbours, that tell whether it is an edge
EDGE = 0.25  # of the reach: the centre of the surface around an edge point is so far from it
BEYOND = 0.25  # least cosine between the way to an image and the way out across the edge
STRICT = 8  # power of support
NEVER = 5  # images that a plane is judged by, at least
POINTS = 8192  # of a larger cloud, that planes of any method are judged by


@dataclass(frozen=True, eq=False)
class Judgement:
    """For K planes (K,): shares of the images that count.

    support: supported, of those supported or contradicting; seen: supported, of all; moved: the points that the plane
    moves far enough to count, of all points.
    """

    support: Tensor
    seen: Tensor
    moved: Tensor

    @property
    def value(self) -> Tensor:
        """By which planes of one cloud are compared."""
        return self.support**4 * self.seen

    @property
    def strict(self) -> Tensor:
        """How much of the surface has a mirror image, what contradicts the symmetry weighing far more: float64."""
        return self.support.double() ** STRICT * self.seen.double()


class Judge:
    """Judges planes of one cloud.

    Args:
        even: (n, 3), the evened cloud, any prefix being a random sample. spacing: of it.
    """

    def __init__(self, even: Tensor, spacing: float):
        self.even, self.spacing, self.neighbours = even, spacing, Neighbours(even)
        self.points = even[:JUDGES]
        own = self.neighbours.distances(even, 2)[:, 1]
        self.reach = (LOOSE * own).clamp(spacing, COARSEST * spacing)  # (n,)
        first = own[:JUDGES]
        self.own = float((first <= self.reach[:JUDGES]).float().mean().clamp_min(0.2))

    def __call__(self, normals: Tensor, offsets: Tensor) -> Judgement:
        """Judge planes (K, 3), (K,)."""
        heights = normals @ self.points.T - offsets[:, None]
        images = mirrored(self.points, normals, offsets)
        counts = heights.abs() > MOVED / 2 * self.spacing
        distances, nearest = self.neighbours.within(images, TOUCHING * self.spacing)
        reach = torch.cat([self.reach, self.reach.new_zeros(1)])[nearest]
        supported = (distances <= reach) & counts
        missing = (distances > CLEAR * reach) & counts
        touching = missing & torch.isfinite(distances)
        hovering = torch.zeros_like(counts)
        hovering[touching] = ~self._beyond_an_edge(images[touching], nearest[touching])
        rate = (hovering.sum(1) + 0.5) / (touching.sum(1) + 1)
        good, lacking, all_ = (each.sum(1) for each in (supported, missing, counts))
        good, bad = good / self.own, lacking * rate
        return Judgement(
            (good / (good + bad).clamp_min(NEVER)).clamp_max(1),
            (good / all_.clamp_min(NEVER)).clamp_max(1),
            all_ / len(self.points),
        )

    def _beyond_an_edge(self, images: Tensor, nearest: Tensor) -> Tensor:
        """Whether each of images (M, 3) continues the surface beyond an edge of it near the point `nearest` (M,)."""
        if not len(images):
            return torch.zeros(0, dtype=torch.bool, device=images.device)
        nearest, back = torch.unique(nearest, return_inverse=True)
        points = self.even[nearest]
        reach = EDGE_REACH * self.spacing
        around = self.even[self.neighbours.query(points, min(FEW, len(self.even)))] - points[:, None]
        inside = (around.norm(dim=-1) <= reach).to(around.dtype)
        centres = (around * inside[..., None]).sum(1) / inside.sum(1, keepdim=True).clamp_min(1)
        out = -centres[back]
        way = images - points[back]
        cosines = (out * way).sum(1) / (out.norm(dim=1) * way.norm(dim=1)).clamp_min(1e-12)
        return (out.norm(dim=1) > EDGE * reach) & (cosines > BEYOND)


@torch.inference_mode()
def supports(points: np.ndarray, planes: Planes) -> np.ndarray:
    """The share (K,) of a cloud's surface that each plane mirrors onto surface, whichever method found the planes.

    Images in places that were not observed do not count; see `Judgement`. A cloud whose points are too few, or lie on a
    straight line, has no surface, and its planes have no support.

    Args:
        points: (N, 3), any unit and position.

    Raises:
        ValueError: for another shape or values that are not finite.
    """
    frame = frame_of(points, POINTS)
    if frame is None or not len(planes):
        return np.zeros(len(planes))
    thin = evened(Neighbours(frame.points))
    return Judge(frame.points[thin.rows], thin.spacing)(*frame.of(planes)).support.double().numpy()
