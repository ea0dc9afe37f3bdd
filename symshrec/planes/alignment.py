"""Which mirrors of a known group a set of planes are: the group turned and moved until it fits them."""

from dataclasses import dataclass

import numpy as np

from symshrec.planes.reflections import Mirrors

SLACK = 3.0  # times the tolerance that planes may be off before the group is fitted to all of them
PAIRS = 24  # of planes, at most, that are brought onto pairs of mirrors
NONE = -1


@dataclass(frozen=True, eq=False)
class Alignment:
    """A group fitted to K planes.

    Attributes:
        slots: (K,), which of the group's mirrors each plane is, -1 where it is none.
        normals: (M, 3), the group's mirrors where they lie. centre: (3,), which they all go through.
        angle: in radians, and distance: the greatest deviation of a plane from its mirror.
    """

    slots: np.ndarray
    normals: np.ndarray
    centre: np.ndarray
    angle: float
    distance: float

    @property
    def matched(self) -> int:
        """Planes that are mirrors of the group."""
        return int((self.slots != NONE).sum())

    @property
    def missing(self) -> np.ndarray:
        """Places of the mirrors that no plane is."""
        return np.setdiff1d(np.arange(len(self.normals)), self.slots)


def aligned(group: Mirrors, normals: np.ndarray, points: np.ndarray, angle: float, distance: float) -> Alignment | None:
    """The group turned and moved to where the most planes are mirrors of it.

    None where some planes are none of its mirrors while some mirrors are none of the planes: that says nothing.

    Args:
        normals: (K, 3), unit. points: (K, 3), on the planes.
        angle: in radians, and distance: in the points' unit, that a plane may be off its mirror.

    >>> from symshrec.planes.reflections import mirrors
    >>> fit = aligned(mirrors("C2v"), np.eye(3)[1:], np.zeros((2, 3)), 0.01, 0.01)
    >>> fit.matched, fit.missing.tolist()
    (2, [])
    """
    rotations = _candidates(group, normals, SLACK * angle)
    if not len(rotations):
        return None
    close = np.abs(normals @ (group.normals @ rotations.swapaxes(1, 2)).swapaxes(1, 2))  # (P, K, M)
    best, found = close.max(axis=2), close.argmax(axis=2)  # (P, K)
    near = best > np.cos(SLACK * angle)
    filled = np.zeros(close.shape[::2], dtype=bool)
    filled[np.nonzero(near)[0], found[near]] = True
    useful = near.all(axis=1) | filled.all(axis=1)
    rotations, near, best, filled = (each[useful] for each in (rotations, near, best, filled))
    order = np.lexsort([-np.where(near, best, 0).sum(axis=1), -near.sum(axis=1), -filled.sum(axis=1)])
    fits = (_fitted(group, rotations[row], normals, points, angle, distance) for row in order[:3])
    return max((fit for fit in fits if fit is not None), key=lambda fit: (fit.matched, -fit.angle), default=None)


def _candidates(group: Mirrors, normals: np.ndarray, slack: float) -> np.ndarray:
    """Rotations (P, 3, 3) that bring two of the mirrors onto two of the planes."""
    if len(normals) < 2:
        return np.zeros((0, 3, 3))
    cosines = np.abs(normals @ normals.T)
    partners = np.argsort(cosines, axis=1)[:, : min(2, len(normals) - 1)]  # the most upright ones
    pairs = {(row, other) for row, others in enumerate(partners) for other in others}
    pairs |= {(row, (row + 1) % len(normals)) for row in range(len(normals))}
    chosen = np.array(sorted(pair for pair in pairs if pair[0] != pair[1]))
    rows, others = chosen[np.linspace(0, len(chosen) - 1, min(PAIRS, len(chosen))).astype(int)].T
    kept = cosines[rows, others] < np.cos(2 * slack)
    between = np.arccos(np.clip((normals[rows[kept]] * normals[others[kept]]).sum(1), -1, 1))
    planes = _frames(normals[rows[kept]], normals[others[kept]])
    a, b = (grid.ravel() for grid in np.meshgrid(group.first, np.arange(len(group.normals)), indexing="ij"))
    a, b = a[a != b], b[a != b]
    first, second = np.tile(group.normals[a], (2, 1)), np.concatenate([group.normals[b], -group.normals[b]])
    wanted = np.arccos(np.clip((first * second).sum(1), -1, 1))
    mirrors = _frames(first, second)
    plane, mirror = np.nonzero(np.abs(between[:, None] - wanted) < 2 * slack)
    return planes[plane] @ mirrors[mirror].swapaxes(1, 2)


def _frames(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Right-handed frames (P, 3, 3) of pairs of directions, their axes as columns."""
    third = np.cross(first, second)
    third /= np.linalg.norm(third, axis=1, keepdims=True)
    return np.stack([first, np.cross(third, first), third], axis=2)


def _fitted(group: Mirrors, rotation, normals, points, angle: float, distance: float) -> Alignment | None:
    """The best rotation and centre from a first rotation on, the worst plane left out until the others are within."""
    allowed = np.ones(len(normals), dtype=bool)
    reach, slots = SLACK * angle, np.full(len(normals), NONE)
    while True:
        for _ in range(3):
            mirrors = group.normals @ rotation.T
            cosines = normals @ mirrors.T  # (K, M)
            nearest = np.abs(cosines).argmax(axis=1)
            angles = _angles(normals, mirrors[nearest])
            slots = np.where(allowed & (angles < reach), nearest, NONE)
            used = slots != NONE
            filled = len(np.unique(slots[used]))
            if filled < 2 or not (used.all() or filled == len(mirrors)):
                return None
            signs = np.sign(cosines[used, slots[used]])
            rotation = _rotation(group.normals[slots[used]], normals[used] * signs[:, None])
        mirrors = group.normals @ rotation.T
        angles = np.where(used, _angles(normals, mirrors[np.where(used, slots, 0)]), 0)
        if angles.max() > angle:
            allowed[angles.argmax()] = False
            continue
        centre, distances = meeting(mirrors[slots[used]], points[used])
        if distances.max() > distance:
            allowed[np.flatnonzero(used)[distances.argmax()]] = False
            continue
        return Alignment(slots, mirrors, centre, float(angles.max()), float(distances.max()))


def _rotation(sources: np.ndarray, targets: np.ndarray) -> np.ndarray:
    """The rotation that brings (K, 3) nearest to (K, 3), after Kabsch."""
    left, _, right = np.linalg.svd(targets.T @ sources)
    return left @ np.diag([1, 1, np.linalg.det(left @ right)]) @ right


def meeting(mirrors: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The place (3,) that all mirrors come nearest to, close to their points, and its distances from them (K,).

    >>> meeting(np.eye(3)[:2], np.array([[1.0, 0, 4], [0, 2, 4]]))[0].tolist()
    [1.0, 2.0, 4.0]
    """
    middle = points.mean(axis=0)
    heights = np.einsum("kd,kd->k", mirrors, points - middle)
    offset = np.linalg.lstsq(mirrors, heights, rcond=1e-6)[0]
    return middle + offset, np.abs(mirrors @ offset - heights)


def _angles(normals: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Between (K, 3) and (K, 3) unit normals, sign ignored."""
    cross = np.linalg.norm(np.cross(normals, others), axis=1)
    return np.arctan2(cross, np.abs((normals * others).sum(axis=1)))
