"""An object to try things on: a chair, as a mesh in metres, standing somewhere in a room."""

from itertools import pairwise
from pathlib import Path

import numpy as np

from symshrec.files.atomic import write_atomically
from symshrec.geometry.rotations import axis_rotation
from symshrec.planes import Planes

EXAMPLE = "chair.ply"
LEG, SEAT, BACK = 0.44, 0.04, 0.46  # lengths of the legs, the seat's thickness and the height of the back, in metres
TURN_DEG, TILT_DEG = 78.0, 8.0  # about the vertical, and leaning forwards
PLACE = (2.4, 1.7, 0.1)


def write_example(path: Path) -> None:
    """Write the chair as a binary ply, unless it is there already.

    Raises:
        ValueError: where another file has its name.
    """
    import trimesh  # nearly a second

    content = trimesh.util.concatenate(_parts()).apply_transform(_pose()).export(file_type="ply")
    if not path.exists():
        write_atomically(path, content)
    elif path.read_bytes() != content:
        raise ValueError(f"{path} is there already and is not the example; move it, or work in another folder")


def example_plane() -> Planes:
    """The chair's one mirror plane, between left and right."""
    pose = _pose()
    return Planes(pose[None, :3, 0], pose[None, :3, 3])


def _pose() -> np.ndarray:
    """(4, 4): first leaning about the chair's own left-right axis, then turned, then put in its place."""
    turn, tilt = np.radians([TURN_DEG, TILT_DEG])
    turned, tilted = axis_rotation(2, turn), axis_rotation(0, tilt)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = turned @ tilted, PLACE
    return pose


def _parts() -> list:
    """The seat, and the right half of everything else with its mirror image; x is right, y is backwards."""
    from trimesh.creation import cylinder

    seat = cylinder(radius=0.23, height=SEAT, sections=48)
    seat.apply_scale([1.0, 0.93, 1.0]).apply_translation([0, 0, LEG + SEAT / 2])
    right = [*_legs(), *_back()]
    return [seat, *right, *(part.copy().apply_transform(np.diag([-1.0, 1.0, 1.0, 1.0])) for part in right)]


def _legs() -> list:
    """Two legs that splay outwards, the rung between them, and half the rung across."""
    from trimesh.creation import cylinder

    legs = [cylinder(radius=0.018, segment=[(0.17, 0.15 * y, LEG), (0.23, 0.21 * y, 0)], sections=16) for y in (-1, 1)]
    rungs = ((0.2, -0.18, 0.2), (0.2, 0.18, 0.2)), ((0, 0, 0.2), (0.2, 0, 0.2))
    return [*legs, *(cylinder(radius=0.01, segment=rung, sections=12) for rung in rungs)]


def _back() -> list:
    """Two spindles and a post on the back edge of the seat, and half the rail on top of them."""
    from trimesh.creation import capsule, cylinder

    angles = np.radians([0, 14, 37, 62])
    feet = np.stack([0.2 * np.sin(angles), 0.19 * np.cos(angles), np.full(4, LEG + SEAT)], axis=1)
    heads = np.stack([0.24 * np.sin(angles), 0.12 + 0.17 * np.cos(angles), np.full(4, LEG + SEAT + BACK)], axis=1)
    upright = zip((0.008, 0.008, 0.015), feet[1:], heads[1:], strict=True)
    back = [cylinder(radius=radius, segment=[foot, head], sections=12) for radius, foot, head in upright]
    rail = [cylinder(radius=0.02, segment=[here, after], sections=16) for here, after in pairwise(heads)]
    return [*back, *rail, capsule(height=0.02, radius=0.022, count=[12, 12]).apply_translation(heads[-1])]
