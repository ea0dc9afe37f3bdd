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
ROUNDING = 1e-12  # of the largest coordinate: a cloud that spreads less is a single point
STEPS = 1 << 20  # of a coordinate, within the cloud's spread, that are told apart
ENOUGH = 4  # times the points asked for, by whose exact coordinates a larger cloud is thinned
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
        normals, offsets = normals.double().cpu().numpy(), offsets.double().cpu().numpy()
        confidences = np.asarray(torch.as_tensor(confidences).cpu(), dtype=np.float64)
        return Planes(normals, normals * offsets[:, None], confidences).transformed(
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

    Everything is worked out on centred points, so that a position far from the origin costs no accuracy.

    Returns:
        None where fewer than four distinct points are left, or all lie on a straight line.

    Raises:
        ValueError: for a wrong shape or values that are not finite.
    """
    device = points.device if isinstance(points, Tensor) else torch.device("cpu")
    points = _distinct(checked(points), most)
    if len(points) < FEWEST_POINTS:
        return None
    rounding = ROUNDING * np.abs(points).max()
    origin = np.median(points, axis=0)
    points = points - origin
    spread = np.median(np.abs(points).max(1))
    spread = spread if spread > rounding else np.abs(points).max()
    if spread <= rounding:
        return None
    kept = _ordered(points, spread, most)
    centre, near = _middle(kept)
    centred = kept - centre
    scale = float(np.sqrt(12 * np.square(centred[near]).sum(1).mean()))
    if near.sum() < FEWEST_POINTS or is_straight(centred[near], COLLINEAR, np.zeros(3)):
        return None
    return Frame(torch.from_numpy((centred / scale).astype(np.float32)).to(device), centre + origin, scale)


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


def _distinct(points: np.ndarray, most: int) -> np.ndarray:
    """The (N, 3) points without repetitions, in an order that theirs does not change; of very many, at least `most`."""
    keys = _hashes((points + 0.0).view(np.uint64))  # + 0.0 makes −0 and 0 one
    if len(points) > ENOUGH * most:  # repetitions share a key, so look a little further than needed
        few = np.flatnonzero(keys <= np.partition(keys, ENOUGH * most)[ENOUGH * most])
        if len(np.unique(keys[few])) >= most:
            points, keys = points[few], keys[few]
    return points[np.unique(keys, return_index=True)[1]]


def _ordered(points: np.ndarray, spread: float, most: int) -> np.ndarray:
    """The distinct points with the `most` smallest hashes of their coordinates, by hash.

    Coordinates are hashed as multiples of a millionth of the spread, so that rounding hardly changes the order.
    """
    cells = np.floor(points * (STEPS / spread) + 0.4).astype(np.int64)
    _, first = np.unique(_hashes(cells.view(np.uint64)), return_index=True)
    return points[first[:most]]


def _hashes(bits: np.ndarray) -> np.ndarray:
    """One pseudo-random number (N,) uint64 for every row of (N, 3) uint64."""
    keys = np.zeros(len(bits), np.uint64)
    for axis, mixer in enumerate(MIXERS):
        keys = (keys ^ bits[:, axis]) * np.uint64(mixer)
        keys ^= keys >> np.uint64(29)
    return keys * np.uint64(MIXERS[0]) ^ (keys >> np.uint64(32))
