"""What mirror planes make together: a point group with its axes of rotation, or a surface of revolution."""

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np

from symshrec.planes.alignment import NONE, Alignment, aligned, meeting
from symshrec.planes.planes import Planes, axis_angles
from symshrec.planes.reflections import RotationAxis, closure, mirrors, rotation_axes

ANGLE_DEG = 1.0  # that a plane may be off its place in the group, as the track's tolerance
DISTANCE = 0.01  # of the cloud's diagonal, that a plane may pass beside the group's centre
LEAST_STEP = 6.0  # tolerances between neighbouring planes of a group; what is denser can't be told from a revolution
REVOLVED, ROUND = 6, 10  # planes from which those through an axis, or a point, look like a revolution, or a sphere
MOST, MOST_ROUND = 2 / 3, 20  # a share of the planes that is most of them; planes that are held against Td, Oh and Ih
UPRIGHT = 0.3  # least sine between two planes that an axis is taken from
EVERYWHERE = 0.1  # least share of the normals' squares in any direction (a third, where they are spread over a sphere)
CONTINUOUS_FOLD = 24  # turns that stand for all where an average over a revolution is taken
CONTINUOUS = {"C∞v": f"C{CONTINUOUS_FOLD}v", "D∞h": f"D{CONTINUOUS_FOLD}h", "Kh": "Ih"}


@dataclass(frozen=True, eq=False)
class PointGroup:
    """The group that mirror planes generate. The object's own may be larger by what has no mirror, such as inversion.

    Attributes:
        name: after Schoenflies: C1 (no plane), Cs, Cnv, Dnh, Td, Oh, Ih, of surfaces of revolution C∞v and D∞h, of
            spheres Kh; "" where the planes make none.
        planes: places of the planes that are mirrors of it. outside: of those that are not.
        missing: its mirrors that no plane is, of confidence 0; not of C∞v, D∞h and Kh.
        centre: (3,), which all mirrors go through; of an axis, the place nearest to the planes' points.
        normals: (M, 3), its mirrors, made exact; of C∞v, D∞h and Kh those of `CONTINUOUS`, which stand for all.
        angle_deg, distance: greatest deviation of its planes, the distance in the planes' unit.
        tolerance_deg: that it was looked for at.
    """

    name: str
    planes: tuple[int, ...]
    outside: tuple[int, ...]
    missing: Planes
    centre: np.ndarray
    normals: np.ndarray
    angle_deg: float
    distance: float
    tolerance_deg: float

    @property
    def complete(self) -> bool:
        """Whether the planes are all the group's mirrors, and no other."""
        return bool(self.name) and not self.outside and not len(self.missing)

    @property
    def continuous(self) -> bool:
        """Whether all rotations about some axis are in it."""
        return self.name in CONTINUOUS

    @cached_property
    def elements(self) -> np.ndarray:
        """Its matrices (G, 3, 3) about the centre, mirrors and rotations, the identity first."""
        return closure(self.normals) if len(self.normals) else np.eye(3)[None]

    @cached_property
    def transforms(self) -> np.ndarray:
        """Its elements as (G, 4, 4), in the planes' coordinates."""
        transforms = np.tile(np.eye(4), (len(self.elements), 1, 1))
        transforms[:, :3, :3] = self.elements
        transforms[:, :3, 3] = self.centre - self.elements @ self.centre
        return transforms

    @cached_property
    def axes(self) -> tuple[RotationAxis, ...]:
        """The axes of its rotations, the highest order first; all go through the centre.

        Of a revolution the one that all rotations are about, of order 0; of a sphere none is special.
        """
        if self.name == "Kh":
            return ()
        axes = rotation_axes(self.elements)
        return (RotationAxis(axes[0].direction, 0),) if self.continuous else axes

    def describe(self) -> str:
        """One sentence or two for people."""
        from symshrec.planes.wording import described  # which is of groups

        return described(self)


def point_group(
    normals: np.ndarray,
    points: np.ndarray,
    diagonal: float | None = None,
    angle_deg: float = ANGLE_DEG,
    distance: float = DISTANCE,
) -> PointGroup:
    """The point group that K mirror planes make, or would make with some that are missing.

    Where all planes are mirrors of one group it is that: with all of the group's mirrors among them, or, at least about
    half of them found, with those that are missing. Else, six or more through one axis are a surface of revolution, and
    ten or more through one point a sphere; else the largest group that some of the planes make is given, and the others
    are outside.

    Args:
        normals: (K, 3), of any length. points: (K, 3), on the planes and near the object.
        diagonal: of the cloud, which `distance` is a share of; None: that planes meet is not asked.
        angle_deg: that a plane may be off its place in the group, above 0 and at most 5.

    Raises:
        ValueError: as `Planes`, and for a tolerance out of its range.

    >>> point_group(np.eye(3)[:2], np.zeros((2, 3))).name
    'C2v'
    >>> group = point_group([[1, 0, 0], [1, 3**0.5, 0]], np.zeros((2, 3)))
    >>> group.name, group.missing.normals.round(3).tolist()
    ('C3v', [[-0.5, 0.866, 0.0]])
    """
    if not 0 < angle_deg <= 5:
        raise ValueError(f"angle_deg is {angle_deg}; it should be above 0 and at most 5 degrees")
    if not distance > 0 or not (diagonal is None or diagonal > 0):
        raise ValueError(f"distance is {distance} and diagonal {diagonal}; both should be above 0")
    planes, limit = Planes(normals, points), np.inf if diagonal is None else distance * diagonal
    if len(planes) < 2:
        rows, centre = tuple(range(len(planes))), planes.points.mean(axis=0) if len(planes) else np.zeros(3)
        name = ("C1", "Cs")[len(planes)]
        return PointGroup(name, rows, (), Planes.empty(), centre, planes.normals, 0.0, 0.0, angle_deg)
    fits = _fits(planes, np.radians(angle_deg), limit)
    whole = {name: fit for name, fit in fits.items() if not len(fit.missing)}
    largest = max(whole, key=lambda name: whole[name].matched, default="")
    of_all = [name for name, fit in fits.items() if fit.matched == len(planes)]
    fewest = min(of_all, key=lambda name: (len(fits[name].missing), fits[name].angle), default="")
    if fewest:
        return _group(fewest, fits[fewest], planes, angle_deg)
    if largest and whole[largest].matched >= MOST * len(planes) > 2:
        return _group(largest, whole[largest], planes, angle_deg)
    revolved = _revolution(planes, np.radians(angle_deg), limit, angle_deg)
    if revolved is not None:
        return revolved
    if largest:
        return _group(largest, whole[largest], planes, angle_deg)
    every, centre = tuple(range(len(planes))), planes.points.mean(axis=0)
    return PointGroup("", (), every, Planes.empty(), centre, np.zeros((0, 3)), 0.0, 0.0, angle_deg)


def _fits(planes: Planes, angle: float, limit: float) -> dict[str, Alignment]:
    """Every group that could be, fitted: those of which about half the mirrors can be there."""
    count, least = len(planes), LEAST_STEP * angle
    folds = range(2, min(2 * count + 1, int(np.pi / least)) + 1)
    names = [f"C{fold}v" for fold in folds] + [f"D{fold}h" for fold in folds if fold <= 2 * count]
    names += ["Td", "Oh", "Ih"] * (count <= MOST_ROUND)
    fits = {}
    for name in names:
        group = mirrors(name)
        if len(group.normals) <= 2 * count + 1:
            fit = aligned(group, planes.normals, planes.points, angle, limit)
            if fit is not None:
                fits[name] = fit
    return fits


def _group(name: str, fit: Alignment, planes: Planes, angle_deg: float) -> PointGroup:
    inside = fit.slots != NONE
    places = np.tile(fit.centre, (len(fit.missing), 1))
    normals = fit.normals[fit.missing]
    signs = np.sign(np.take_along_axis(normals, np.abs(normals).argmax(axis=1)[:, None], axis=1))
    missing = Planes(normals * signs + 0.0, places, np.zeros(len(places)))
    of_it, outside = (tuple(np.flatnonzero(each).tolist()) for each in (inside, ~inside))
    return PointGroup(
        name, of_it, outside, missing, fit.centre, fit.normals, np.degrees(fit.angle), fit.distance, angle_deg
    )


def _revolution(planes: Planes, angle: float, limit: float, angle_deg: float) -> PointGroup | None:
    """C∞v, D∞h or Kh, where most of many planes go through one axis or one point; None where they do not."""
    normals = planes.normals
    axis, around = _axis(normals, angle)
    if around.sum() >= max(REVOLVED, MOST * len(planes)):
        across = axis_angles(normals, axis[None])[:, 0] < angle
        ideal = np.where(around[:, None], normals - np.outer(normals @ axis, axis), axis)
        ideal /= np.linalg.norm(ideal, axis=1, keepdims=True)
        name, least = "D∞h" if across.any() else "C∞v", REVOLVED
    elif len(planes) >= ROUND and np.linalg.eigvalsh(normals.T @ normals / len(planes))[0] > EVERYWHERE:
        around, across, ideal = np.ones(len(planes), bool), np.zeros(len(planes), bool), normals
        name, least = "Kh", ROUND
    else:
        return None
    inside = around | across
    while True:
        centre, distances = meeting(ideal[inside], planes.points[inside])
        if distances.max() <= limit:
            break
        inside[np.flatnonzero(inside)[distances.argmax()]] = False
        if (around & inside).sum() < max(least, MOST * len(planes)):
            return None
    if name == "D∞h" and not (across & inside).any():
        name = "C∞v"
    of_it, outside = (tuple(np.flatnonzero(each).tolist()) for each in (inside, ~inside))
    off = np.degrees(np.arcsin(np.abs(normals - (normals * ideal).sum(1)[:, None] * ideal)[inside].max().clip(max=1)))
    turned = mirrors(CONTINUOUS[name]).normals @ _frame(axis).T
    return PointGroup(
        name, of_it, outside, Planes.empty(), centre, turned, float(off), float(distances.max()), angle_deg
    )


def _axis(normals: np.ndarray, angle: float) -> tuple[np.ndarray, np.ndarray]:
    """The direction (3,) that the most planes contain, and which do: (K,) bool."""
    first, second = np.array(list(combinations(range(len(normals)), 2))).T
    crossed = np.cross(normals[first], normals[second])
    axes = crossed[np.linalg.norm(crossed, axis=1) > UPRIGHT]
    if not len(axes):
        return np.array([0.0, 0, 1]), np.zeros(len(normals), dtype=bool)
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    axis = axes[(np.abs(axes @ normals.T) < np.sin(2 * angle)).sum(axis=1).argmax()]
    around = np.abs(normals @ axis) < np.sin(2 * angle)
    axis = np.linalg.svd(normals[around])[2][2]
    axis = axis * np.sign(axis[np.abs(axis).argmax()])
    return axis, np.abs(normals @ axis) < np.sin(angle)


def _frame(axis: np.ndarray) -> np.ndarray:
    """A rotation (3, 3) that takes z to `axis`."""
    first = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(axis, first), axis], axis=1)
