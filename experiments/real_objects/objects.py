"""The objects with their true planes, as experiments/real_objects.json keeps them, and how that is made anew."""

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from experiments.real_objects.meshes import OBJECTS, Entry, Frame, MeshSurface, listed, read
from experiments.real_objects.truth import true_planes
from symshrec.files.atomic import write_atomically
from symshrec.planes import Planes


@dataclass(frozen=True, eq=False)
class Object:
    """A mesh in our frame (z up, box about 0, diagonal DIAGONAL), its exact planes and those that are nearly so."""

    name: str
    surface: MeshSurface
    planes: Planes
    nearly: Planes
    sha256: str


def entry_of(each: dict) -> Entry:
    """The file of an object of the list."""
    return Entry(each["name"], each["package"], each["file"], each["up"])


def load(each: dict, packages: Path) -> Object:
    """An object of the list.

    Raises:
        ValueError: where its file is missing, or another than the truth was found on.
    """
    surface, frame, sha256 = read(packages, entry_of(each))
    if sha256 != each.get("sha256"):
        raise ValueError(
            f"{packages / each['file']} is not the file whose planes {OBJECTS.name} holds; install the versions of "
            "real_meshes.txt, or find its planes with --truth"
        )
    planes, nearly = (_in_frame(each[key], frame) for key in ("planes", "nearly"))
    return Object(each["name"], surface, planes, nearly, sha256)


def find_truth(packages: Path, names: Iterable[str], path: Path = OBJECTS) -> None:
    """Find the planes of the named objects on their meshes and write them into the list, object by object."""
    table = listed(path)
    for each in table["objects"]:
        if each["name"] not in names:
            continue
        surface, frame, each["sha256"] = read(packages, entry_of(each))
        exact, nearly = true_planes(surface.triangles)
        each["planes"], each["nearly"] = _in_file(exact, frame), _in_file(nearly, frame)
        write_atomically(path, _text(table).encode())
        print(f"{each['name']}: {len(exact)} exact, {len(nearly)} nearly", flush=True)


def _in_frame(rows: list, frame: Frame) -> Planes:
    """Rows (normal, point, share) of a file's frame as planes of ours, their points at the object's middle (P15)."""
    table = np.array(rows, dtype=float).reshape(-1, 7)
    planes = Planes(table[:, :3], table[:, 3:6], table[:, 6])
    return planes.transformed(frame.rotation, frame.translation, frame.scale).canonical()


def _in_file(planes: Planes, frame: Frame) -> list:
    back = frame.rotation.T
    moved = planes.transformed(back, -back @ frame.translation / frame.scale, 1 / frame.scale)
    rows = np.column_stack([moved.normals, moved.points, moved.confidences])
    return [[float(f"{value:.7g}") + 0.0 for value in row] for row in rows]


def _text(table: dict) -> str:
    """JSON with a plane to a line."""
    text = json.dumps(table, indent=1, ensure_ascii=False)
    lines, row = [], ""
    for line in text.splitlines():
        bare = line.strip()
        inside = row or (bare == "[" and lines and lines[-1].strip() != "")
        if inside:
            row += bare + (" " if bare.endswith(",") else "")
            if bare.startswith("]"):
                lines.append(line[: len(line) - len(line.lstrip())] + row)
                row = ""
        else:
            lines.append(line)
    return "\n".join(lines) + "\n"
