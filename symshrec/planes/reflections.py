"""The finite groups that mirrors through one point generate: Cnv, Dnh, Td, Oh and Ih, after Coxeter."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

GOLDEN = (1 + 5**0.5) / 2
LARGEST = 480  # elements of a group that is closed; D120h has as many
SAME = 1e-6  # entries of two matrices that are one element differ by less


class RotationAxis(NamedTuple):
    """direction (3,), unit; order: rotations by 360°/order about it are symmetries, 0 where all rotations are."""

    direction: np.ndarray
    order: int


class Mirrors(NamedTuple):
    """A group by its Schoenflies name and its mirrors' unit normals (M, 3); `first` is one of each kind of mirror."""

    name: str
    normals: np.ndarray
    first: np.ndarray


def reflection(normals: np.ndarray) -> np.ndarray:
    """The matrices (..., 3, 3) that mirror across planes through the origin with unit normals (..., 3).

    >>> reflection(np.array([1.0, 0, 0])).diagonal().tolist()
    [-1.0, 1.0, 1.0]
    """
    return np.eye(3) - 2 * normals[..., :, None] * normals[..., None, :]


def closure(normals: np.ndarray) -> np.ndarray:
    """All products of the mirrors through the origin with unit normals (K, 3): (G, 3, 3), the identity first.

    Raises:
        ValueError: where there are more than 480, so that the planes generate no small group.

    >>> len(closure(np.eye(3)))
    8
    """
    generators, elements = reflection(np.asarray(normals, dtype=np.float64)).reshape(-1, 3, 3), np.eye(3)[None]
    new = elements
    while len(new):
        products = (new[:, None] @ generators[None]).reshape(-1, 3, 3)
        products = products[np.unique(np.round(products.reshape(-1, 9), 5) + 0.0, axis=0, return_index=True)[1]]
        far = np.abs(products[:, None] - elements[None]).max(axis=(2, 3)).min(axis=1) > SAME
        new = _distinct(products[far])
        elements = np.concatenate([elements, new])
        if len(elements) > LARGEST:
            raise ValueError(f"the {len(generators)} planes generate more than {LARGEST} elements; they make no group")
    return elements


def _distinct(elements: np.ndarray) -> np.ndarray:
    """The first of all that are one element: rounding alone would part what lies at a rounding's edge."""
    close = np.abs(elements[:, None] - elements[None]).max(axis=(2, 3)) < SAME
    return elements[close.argmax(axis=1) == np.arange(len(elements))] if len(elements) else elements


def rotation_axes(elements: np.ndarray) -> tuple[RotationAxis, ...]:
    """The axes of a finite group's rotations, those of the highest order first.

    Args:
        elements: (G, 3, 3), all of the group's.

    >>> [axis.order for axis in rotation_axes(closure(np.eye(3)))]
    [2, 2, 2]
    """
    turns = elements[(np.linalg.det(elements) > 0) & (np.trace(elements, axis1=1, axis2=2) < 3 - SAME)]
    if not len(turns):
        return ()
    directions = np.linalg.svd(turns - np.eye(3))[2][:, 2]  # what a rotation leaves as it is
    leading = np.take_along_axis(directions, np.abs(directions).argmax(axis=1)[:, None], axis=1)
    directions = directions * np.sign(leading)
    same = np.abs(directions @ directions.T) > 1 - SAME
    first = np.unique(same.argmax(axis=1))
    axes = [RotationAxis(directions[row] + 0.0, int(same[row].sum()) + 1) for row in first]
    return tuple(sorted(axes, key=lambda axis: -axis.order))


@lru_cache(maxsize=256)
def mirrors(name: str) -> Mirrors:
    """The mirrors of Cs, Cnv (n ≥ 2, about z), Dnh (n ≥ 2, about z), Td, Oh or Ih, through the origin.

    Raises:
        ValueError: for another name.

    >>> [len(mirrors(name).normals) for name in ("Cs", "C3v", "D3h", "Td", "Oh", "Ih")]
    [1, 3, 4, 6, 9, 15]
    """
    family, fold = name[0] + name[-1], name[1:-1]
    diagonals = np.array([(0, 1, 1), (0, 1, -1), (1, 0, 1), (-1, 0, 1), (1, 1, 0), (1, -1, 0)]) / 2**0.5
    first = [0]
    if name == "Cs":
        normals = np.eye(3)[:1]
    elif family in ("Cv", "Dh") and fold.isdecimal() and int(fold) >= 2:
        angles = np.pi * np.arange(int(fold)) / int(fold)
        normals = np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)], axis=1)
        first = [0, 1] if int(fold) % 2 == 0 else [0]
        if family == "Dh":
            normals, first = np.concatenate([normals, np.eye(3)[2:]]), [*first, int(fold)]
    elif name in ("Td", "Oh"):
        normals, first = (diagonals, [0]) if name == "Td" else (np.concatenate([np.eye(3), diagonals]), [0, 3])
    elif name == "Ih":
        corner = np.array([[1.0, s * GOLDEN, t / GOLDEN] for s in (1, -1) for t in (1, -1)]) / 2
        normals = np.concatenate([np.eye(3), *(np.roll(corner, shift, axis=1) for shift in range(3))])
    else:
        raise ValueError(f"{name!r} is no group of mirrors; there are Cs, Cnv, Dnh (n from 2 on), Td, Oh and Ih")
    return Mirrors(name, normals, np.array(first))
