"""What planes make, in a sentence for people."""

import numpy as np

from symshrec.planes.groups import PointGroup

FIGURES = 5  # decimals of a direction


def described(group: PointGroup) -> str:
    """The group's name, its axes, what is missing and what does not belong to it; planes are counted from 1.

    >>> from symshrec.planes import Planes
    >>> described(Planes([[1, 0, 0]], [[0, 0, 0]]).group())
    'point group Cs: one mirror plane'
    """
    count = len(group.planes) + len(group.outside)
    if count < 2:
        return ("no mirror plane", "point group Cs: one mirror plane")[count]
    at = f"at {group.tolerance_deg:g}°"
    if not group.name:
        return f"{count} planes; no group {at}"
    left = f" {_listed(group.outside)} not belong to it." if group.outside else ""
    if group.name == "Kh":
        return f"{len(group.planes)} planes through one point: this looks like a sphere{_place(group)}.{left}"
    if group.continuous:
        beside = " and one across it" * (group.name == "D∞h")
        through = len(group.planes) - (group.name == "D∞h")
        return (
            f"{through} planes through one axis{beside}: this looks like a surface of revolution "
            f"(axis {direction(group.axes[0].direction)}{_place(group)}), {group.name}.{left}"
        )
    missing = len(group.missing)
    if missing and not left:
        seem = "one seems" if missing == 1 else f"{missing} seem"
        return f"{count} planes; no group {at}: {seem} missing of {group.name}, {_axes(group)}"
    if left:
        return f"{count} planes; no group {at}: {len(group.planes)} of them make {group.name}, {_axes(group)}.{left}"
    return f"point group {group.name}: {count} mirrors, {_axes(group)}"


def headline(group: PointGroup) -> str:
    """The group in few words, for a picture.

    >>> from symshrec.planes import Planes
    >>> headline(Planes([[1, 0, 0], [0, 1, 0]], [[0, 0, 0], [0, 0, 0]]).group())
    'C2v: 2 mirror planes, 1 axis of order 2'
    """
    count = len(group.planes)
    planes = f"{count} mirror plane{'s' * (count != 1)}"
    if group.continuous:
        kind = "a sphere" if group.name == "Kh" else "a surface of revolution"
        return f"{group.name}: {planes}, {kind}"
    if not group.complete:
        return f"{count + len(group.outside)} mirror planes, no group"
    orders = [axis.order for axis in group.axes]
    axes = [
        f"{orders.count(n)} ax{'e' if orders.count(n) > 1 else 'i'}s of order {n}" for n in sorted(set(orders))[::-1]
    ]
    return f"{group.name}: {', '.join([planes, *axes])}"


def direction(vector: np.ndarray) -> str:
    """Three numbers, without a minus before zero.

    >>> direction(np.array([0.0, -1e-9, 1]))
    '0.00000 0.00000 1.00000'
    """
    return " ".join(f"{value:.{FIGURES}f}" for value in np.round(vector, FIGURES) + 0.0)


def _axes(group: PointGroup) -> str:
    """How many axes of which order; where it lies, too, if one is the highest alone."""
    orders = [axis.order for axis in group.axes]
    counts = [f"{orders.count(order)} of order {order}" for order in sorted(set(orders), reverse=True)]
    main = f" (axis {direction(group.axes[0].direction)}{_place(group)})" * (orders.count(orders[0]) == 1)
    return f"axes of rotation: {', '.join(counts)}{main}"


def _place(group: PointGroup) -> str:
    return f" through {' '.join(f'{value:.6g}' for value in group.centre + 0.0)}"


def _listed(rows: tuple[int, ...]) -> str:
    numbers = [str(row + 1) for row in rows]
    if len(numbers) == 1:
        return f"Plane {numbers[0]} does"
    return f"Planes {', '.join(numbers[:-1])} and {numbers[-1]} do"
