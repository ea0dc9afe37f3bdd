"""M4 step 1: a cloud in a frame of its own: checked, centred, scaled, in an order that its points alone decide."""

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from symshrec.geometry.straight import is_straight
from symshrec.planes import Planes

FEWEST_POINTS = 4
COLLINEAR = 1e-5  # of the spread: a cloud thinner than this in two directions is a straight line
STRAY, STRAY_ROUNDS = 20.0, 5  # medians of the distance to the centroid beyond which a point is a stray
MIXERS = (0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9)  # odd constants of splitmix and xxHash


@dataclass(frozen=True, eq=False)
class Frame:
    """points (N, 3) float32 about 0, sized so that their spread is that of a box of diagonal 1; x ↦ scale x + centre.

    Any prefix of the points is a random sample of the cloud that does not depend on the order they came in.
    """

    points: Tensor
    centre: np.ndarray
    scale: float

    def planes(self, normals: Tensor, offsets: Tensor, confidences: Tensor | np.ndarray) -> Planes:
        """Planes n·x = offset of this frame, in the cloud's own coordinates, through the points nearest its centre."""
        directions, distances = normals.double().cpu().numpy(), offsets.double().cpu().numpy()
        confidences = np.asarray(torch.as_tensor(confidences).cpu(), dtype=np.float64)
        return Planes(directions, directions * distances[:, None], confidences).transformed(
            scale=self.scale, translation=self.centre
        )

    def of(self, planes: Planes) -> tuple[Tensor, Tensor]:
        """Normals (K, 3) and offsets (K,) float32 in this frame of planes in the cloud's coordinates."""
        here = planes.transformed(scale=1 / self.scale, translation=-self.centre / self.scale)
        device = self.points.device
        return torch.tensor(here.normals).float().to(device), torch.tensor(here.offsets).float().to(device)


def checked(points) -> np.ndarray:
    """(N, 3) float64, from an array or tensor.

    Raises:
        ValueError: for a wrong shape or values that are not finite.
    """
    points = points.detach().to("cpu", torch.float64).numpy() if isinstance(points, Tensor) else points
    points = np.asarray(points)
    if points.ndim != 2 or points.shape[1] != 3:
        raise ValueError(f"points have shape {points.shape}, expected (N, 3)")
    if not np.isfinite(points).all():
        raise ValueError(f"point {int(np.argwhere(~np.isfinite(points))[0, 0])} is not finite")
    return points.astype(np.float64)


def frame_of(points, most: int) -> Frame | None:
    """The frame of (N, 3) points, at most `most` of them kept, coincident ones once.

    Returns:
        None where fewer than four distinct points are left, or all lie on a straight line.

    Raises:
        ValueError: for a wrong shape or values that are not finite.
    """
    device = points.device if isinstance(points, Tensor) else torch.device("cpu")
    points = checked(points)
    if len(points) < FEWEST_POINTS:
        return None
    kept = _ordered(points, most)
    centre, near = _middle(kept)
    centred = kept - centre
    scale = float(np.sqrt(12 * np.square(centred[near]).sum(1).mean()))
    if near.sum() < FEWEST_POINTS or scale <= 1e-12 * np.abs(centre).max():
        return None
    if is_straight(centred[near], COLLINEAR, np.zeros(3)):
        return None
    return Frame(torch.from_numpy((centred / scale).astype(np.float32)).to(device), centre, scale)


def _middle(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The centroid (3,) of points (N, 3) but the far strays, and which are none (N,): all, but in damaged scans."""
    near = np.ones(len(points), dtype=bool)
    for _ in range(STRAY_ROUNDS):
        centre = points[near].mean(0)
        distances = np.linalg.norm(points - centre, axis=1)
        now = distances <= STRAY * np.median(distances)
        if (now == near).all() or now.sum() < FEWEST_POINTS:
            break
        near = now
    return points[near].mean(0), near


def _ordered(points: np.ndarray, most: int) -> np.ndarray:
    """The distinct points with the `most` smallest hashes of their coordinates, by hash."""
    keys = _hashes(points)
    if len(points) > 4 * most:  # repetitions share a hash, so look a little further than needed
        few = np.flatnonzero(keys <= np.partition(keys, 4 * most)[4 * most])
        if len(np.unique(keys[few])) >= most:
            points, keys = points[few], keys[few]
    keys, first = np.unique(keys, return_index=True)
    return points[first[:most]]


def _hashes(points: np.ndarray) -> np.ndarray:
    bits = (points + 0.0).view(np.uint64)  # + 0.0 makes −0 and 0 one
    keys = np.zeros(len(points), np.uint64)
    for axis, mixer in enumerate(MIXERS):
        keys = (keys ^ bits[:, axis]) * np.uint64(mixer)
        keys ^= keys >> np.uint64(29)
    return keys * np.uint64(MIXERS[0]) ^ (keys >> np.uint64(32))
