"""Every method on every object under every condition, stored row by row, so that a kill costs one row at most."""

import hashlib
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from experiments.real_objects.conditions import CONDITIONS, POINTS, Cloud, make
from experiments.real_objects.meshes import DIAGONAL
from experiments.real_objects.methods import OF_MESHES, opened
from experiments.real_objects.objects import Object, load
from symshrec.benchmark.manifest import GENERATOR_VERSION
from symshrec.files.atomic import sole_writer
from symshrec.planes import Planes
from symshrec.runs.provenance import code_version

ROWS = "rows.jsonl"


class Row(NamedTuple):
    """What a method found in a cloud: planes with confidences, the true and the allowed ones, CPU seconds.

    made: of what it depends on; code: of the package, where it was made.
    """

    object: str
    condition: str
    made: str
    planes: Planes
    true: Planes
    allowed: Planes
    seconds: float
    code: dict


def study(objects, conditions: Sequence[str], methods: Sequence[str], folder: Path, packages: Path, again=False):
    """Make the rows that are missing, or that another version of the method or the conditions made.

    Args:
        objects: of the list. folder: of the rows. again: make those too that are up to date.

    Raises:
        ValueError: where a package is missing, saying how to install it, or another process makes the same rows.
    """
    for method in methods:
        names = [name for name in conditions if name in OF_MESHES.get(method, conditions)]
        detect, identity = opened(method, folder / "pyclarcs/site")
        code = code_version()
        with sole_writer(folder / method), tqdm(total=len(objects) * len(names), desc=method, disable=None) as bar:
            known = {(row.object, row.condition): row.made for row in stored(folder, method)}
            for each in objects:
                shape = load(each, packages)
                for name in names:
                    made = made_of(shape, name, identity)
                    if again or known.get((shape.name, name)) != made:
                        cloud = make(shape.surface, shape.planes, shape.nearly, shape.name, name)
                        planes, seconds = detect(cloud.points, shape.surface, cloud.turn)
                        append(folder / method / ROWS, line(shape.name, name, made, cloud, planes, seconds, code))
                    bar.update()


def made_of(shape: Object, condition: str, identity: dict) -> str:
    """A digest of all that decides a row."""
    planes = [np.round(each.normals, 6).tolist() for each in (shape.planes, shape.nearly)]
    parts = [shape.sha256, planes, CONDITIONS[condition].described(), DIAGONAL, POINTS, GENERATOR_VERSION, identity]
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:16]


def line(name: str, condition: str, made: str, cloud: Cloud, planes: Planes, seconds: float, code: dict) -> str:
    """A row as JSON; `read_line` is its inverse."""
    tables = {key: _table(each) for key, each in (("planes", planes), ("true", cloud.true), ("allowed", cloud.allowed))}
    row = {"object": name, "condition": condition, "made": made, **tables, "seconds": round(seconds, 4), "code": code}
    return json.dumps(row)


def read_line(text: str) -> Row:
    """A row from its JSON."""
    row = json.loads(text)
    return Row(**{key: _planes(value) if key in ("planes", "true", "allowed") else value for key, value in row.items()})


def stored(folder: Path, method: str) -> Iterator[Row]:
    """The rows of a method, the last of those made twice; a line that a kill cut short does not count."""
    path = folder / method / ROWS
    text = path.read_text(encoding="utf-8") if path.exists() else ""
    rows = [read_line(each) for each in text.splitlines(keepends=True) if each.endswith("\n") and each.strip()]
    yield from {(row.object, row.condition): row for row in rows}.values()


def append(path: Path, text: str) -> None:
    """Add a line; what a kill left of the line before goes."""
    with open(path, "a+b") as file:
        file.seek(0)
        whole = file.read().rfind(b"\n") + 1
        file.truncate(whole)
        file.write(text.encode() + b"\n")


def _table(planes: Planes) -> list:
    return np.round(np.column_stack([planes.normals, planes.points, planes.confidences]), 7).tolist()


def _planes(rows: list) -> Planes:
    table = np.array(rows, dtype=float).reshape(-1, 7)
    return Planes(table[:, :3], table[:, 3:6], table[:, 6])
