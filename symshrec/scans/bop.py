"""A shape's symmetries in the models_info.json of the BOP benchmark of 6D pose estimation (Hodaň et al. 2018).

Lengths are millimetres. BOP knows proper rotations: two mirrors make one, a single mirror none. Its transforms are
4 × 4, row by row; an axis of all rotations is a direction and a point on it, the offset.
https://github.com/thodan/bop_toolkit/blob/master/docs/bop_datasets_format.md
"""

import json
import re
from pathlib import Path

import numpy as np
from scipy.spatial import ConvexHull, QhullError
from scipy.spatial.distance import cdist

from symshrec.files.atomic import write_atomically
from symshrec.planes import PointGroup

OBJECT = re.compile(r"obj_(\d+)", re.IGNORECASE)  # what BOP calls its models, such as obj_000005.ply
DISCRETE, CONTINUOUS = "symmetries_discrete", "symmetries_continuous"
SAME_SIZE = 0.05  # share by which a shape's diameter may differ from that of the entry it updates
BLOCK = 1000  # points whose distances to all others are held at once
DECIMALS = 9  # of rotations


def object_id(stem: str) -> int | None:
    """The object's ID in a file's name, None where it has none.

    >>> object_id("obj_000005"), object_id("box")
    (5, None)
    """
    found = OBJECT.fullmatch(stem)
    return int(found[1]) if found else None


def symmetries(group: PointGroup, scale: float = 1.0) -> dict[str, list]:
    """BOP's fields of a group, those alone that hold something: transforms but the identity, and axes.

    Args:
        scale: millimetres in the planes' unit.

    Raises:
        ValueError: for a sphere, whose rotations are more than any number of BOP's axes.

    >>> from symshrec.planes import Planes
    >>> symmetries(Planes([[1, 0, 0], [0, 1, 0]], [[5, 0, 0], [5, 0, 0]]).group())[DISCRETE]
    [[-1.0, 0.0, 0.0, 10.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]]
    >>> symmetries(Planes([[1, 0, 0]], [[5, 0, 0]]).group())
    {}
    """
    if group.name == "Kh":
        raise ValueError("BOP's format has no field for a sphere, which every rotation maps onto itself")
    transforms = group.transforms.copy()
    fields: dict[str, list] = {}
    if group.continuous:  # all others are turned by the axis into these
        axis = group.axes[0].direction
        flips = transforms[(transforms[:, :3, :3] @ axis) @ axis < -1 + 1e-6]
        flips = flips[np.linalg.det(flips[:, :3, :3]) > 0][:1]
        fields[CONTINUOUS] = [{"axis": _plain(axis), "offset": _plain(group.centre * scale)}]
    else:
        flips = transforms[1:][np.linalg.det(transforms[1:, :3, :3]) > 0]
    flips[:, :3, 3] *= scale
    if len(flips):
        fields[DISCRETE] = [_plain(each) for each in flips]
    return fields


def measures(points: np.ndarray) -> dict[str, float]:
    """BOP's other fields: the greatest distance between two of (N, 3) points, and their box."""
    try:
        hull = points[ConvexHull(points).vertices]
    except (QhullError, ValueError):  # flat
        hull = np.unique(points, axis=0)
    low, sides = points.min(axis=0), np.ptp(points, axis=0)
    blocks = (hull[start : start + BLOCK] for start in range(0, len(hull), BLOCK))  # all at once may not fit in memory
    fields = {"diameter": max((float(cdist(block, hull).max()) for block in blocks), default=0.0)}
    fields |= {f"min_{name}": float(value) for name, value in zip("xyz", low, strict=True)}
    return fields | {f"size_{name}": float(value) for name, value in zip("xyz", sides, strict=True)}


def update_models_info(path: Path, number: int, points: np.ndarray, group: PointGroup, scale: float = 1.0) -> dict:
    """Put an object's symmetries into a models_info.json, which is made where it is not there; gives its entry.

    Of an entry that is there, the symmetries alone are replaced; other objects stay as they are.

    Args:
        points: (N, 3), the model's vertices. scale: millimetres in their unit.

    Raises:
        ValueError: for a file that is no models_info.json, an entry of another size, which is another object or unit,
            and as `symmetries`.
    """
    entries = _entries(path)
    fields, sizes = symmetries(group, scale), measures(points * scale)
    entry = entries.get(str(number), {})
    if not isinstance(entry, dict):
        raise ValueError(f"{path}: object {number} is no set of fields; is it BOP's models_info.json?")
    there = entry.get("diameter", sizes["diameter"])
    if not isinstance(there, int | float) or abs(there - sizes["diameter"]) > SAME_SIZE * sizes["diameter"]:
        raise ValueError(
            f"{path}: object {number} has a diameter of {there} mm there and of {sizes['diameter']:.6g} mm in this "
            "file; is it another object, or is its unit not the millimetre (--bop-scale)?"
        )
    entry = {key: value for key, value in entry.items() if key not in (DISCRETE, CONTINUOUS)}
    entries[str(number)] = sizes | entry | fields
    lines = [f"  {json.dumps(key)}: {json.dumps(value)}" for key, value in entries.items()]
    write_atomically(path, ("{\n" + ",\n".join(lines) + "\n}\n").encode())
    return entries[str(number)]


def _entries(path: Path) -> dict:
    if not path.exists():
        return {}
    try:
        entries = json.loads(path.read_bytes())
    except ValueError as error:
        raise ValueError(f"{path}: this is no JSON ({error}); name another file") from error
    if not isinstance(entries, dict):
        raise ValueError(f"{path}: it holds no objects by their IDs; is it BOP's models_info.json?")
    return entries


def _plain(values: np.ndarray) -> list[float]:
    return (np.round(values, DECIMALS) + 0.0).ravel().tolist()
