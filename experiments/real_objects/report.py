"""results/real.md: the methods' scores by condition, the objects, and what made the rows."""

from collections.abc import Iterable, Sequence
from importlib.metadata import version
from itertools import pairwise
from pathlib import Path

import numpy as np

from experiments.real_objects.conditions import CONDITIONS, DRAWN, FIXED
from experiments.real_objects.methods import CLARCS_POINTS, METHODS, OF_MESHES
from experiments.real_objects.scores import RIGHT, Score, fates, near, score
from experiments.real_objects.study import Row, stored
from symshrec.files.atomic import write_atomically
from symshrec.reporting.tables.typeset import Grid, Text, markdown
from symshrec.runs.provenance import hardware

MEASURES = {
    "Planes found": ("found", max, "The share of the true planes, mean over the objects that have some."),
    "First plane right": ("first", max, "The share of these objects whose most confident plane is a true one."),
    "False planes an object": ("false", min, "Mean over all objects, those without a plane too."),
}
BANDS = (0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0)  # of confidence
CONFIDENT = "m4"  # whose confidences the page holds against the truth
MEANING = """Planes of {name} by confidence, over all clouds: how many are right, or at least not false, beside what
their confidence says, and how many of the {true:,} true planes are found by planes that are at least so confident.
"""
HEAD = """# Real objects

{symmetric} objects with exact mirror planes and {other} without, meshes that PyPI's packages ship, under the
benchmark's perturbations: at the strengths that the benchmark draws, and at fixed ones. An object's planes were found
on its mesh, without any of the methods below: *exact* where 95 % of the surface has its mirror image within .2 % of the
diagonal, *nearly* true from 80 % on, which is neither right nor false. Every cloud has 8,000 points (fewer where points
are taken away, more where outliers or a floor come in) under a random rotation. A plane is *claimed* at a confidence of
.5 or more; where a method gives no confidence, every plane is. A true plane is found by a claimed one within 1° and, at
the object's middle, 1 % of its diagonal; a claimed plane is false beyond 3° or 2 % of every true and nearly true one.

`pyclarcs` gives one plane, of {points:,} points at most, since its time grows with their square. trimesh knows no
mirror planes: `trimesh` are the three planes across a mesh's axes of inertia, from which its `symmetry` comes.

Made by `python experiments/real.py`, whose first lines say what to install; killed, it goes on where it was.

![Objects as scanners see them, with M4's planes](figures/real.png)
"""


def write(objects: Sequence[dict], packages: dict, folder: Path, path: Path) -> None:
    """Write the page from the rows stored in `folder`."""
    names = {each["name"] for each in objects}
    rows = {method: [row for row in stored(folder, method) if row.object in names] for method in METHODS}
    rows = {method: each for method, each in rows.items() if each}
    scored = {m: {(r.object, r.condition): score(r.planes, r.true, r.allowed) for r in rows[m]} for m in rows}
    symmetric = sum(bool(each["planes"]) for each in objects)
    parts = [HEAD.format(symmetric=symmetric, other=len(objects) - symmetric, points=CLARCS_POINTS)]
    for title, (key, best, meaning) in MEASURES.items():
        parts.append(f"## {title}\n\n{meaning}\n")
        for kind, conditions in (("As the benchmark draws it", DRAWN), ("At a fixed strength", FIXED)):
            parts.append(markdown(measure_grid(scored, conditions, kind, key, best)))
    if CONFIDENT in rows:
        true = sum(len(row.true) for row in rows[CONFIDENT])
        parts += ["## Confidence\n", MEANING.format(name=CONFIDENT, true=true)]
        parts.append(markdown(confidence_grid(rows[CONFIDENT])))
    parts += ["## Time\n", markdown(time_grid(rows)), "## Objects\n", _about(packages, objects)]
    parts += [markdown(object_grid(objects, scored)), "## What made these figures\n", made_by(rows, len(objects))]
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, "\n".join(parts).encode())


def measure_grid(scored: dict, conditions: Iterable[str], kind: str, key: str, best) -> Grid:
    """Conditions × methods; the best of a row is strong."""
    rows = []
    for name in conditions:
        means = [mean([s for (_, each), s in scored[method].items() if each == name], key) for method in scored]
        values = [round(value, 2) for value in means if not np.isnan(value)]
        top = best(values) if len(values) > 1 else np.nan
        cells = [Text("–" if np.isnan(value) else f"{value:.2f}", round(value, 2) == top) for value in means]
        rows.append([Text(CONDITIONS[name].title), *cells])
    return Grid(kind, ["condition", *scored], rows)


def mean(scores: Sequence[Score], key: str) -> float:
    """Of a measure over the clouds that have it; NaN where none has."""
    values = np.array([getattr(each, key) for each in scores], dtype=float)
    values = values[~np.isnan(values)]
    return float(values.mean()) if len(values) else np.nan


def confidence_grid(rows: Sequence[Row]) -> Grid:
    """What became of planes in bands of confidence."""
    confidence = np.concatenate([row.planes.confidences for row in rows])
    fate = np.concatenate([fates(row.planes, row.true, row.allowed) for row in rows])
    found = np.concatenate([_most_confident(row) for row in rows])
    lines = []
    for low, high in pairwise(BANDS):
        of_it = (confidence >= low) & ((confidence < high) | (high == BANDS[-1]))
        count = int(of_it.sum())
        shares = ((fate[of_it] > 0).mean(), (fate[of_it] >= 0).mean(), confidence[of_it].mean()) if count else ()
        cells = [f"{count:,}", *(f"{each:.2f}" for each in shares or [np.nan] * 3), f"{(found >= low).mean():.2f}"]
        lines.append([Text(cell) for cell in (f"{low:.1f} to {high:.1f}", *cells)])
    heads = ["confidence", "planes", "right", "not false", "mean confidence", "true planes found from here on"]
    return Grid("All conditions", heads, lines)


def _most_confident(row: Row) -> np.ndarray:
    """Of each true plane (T,): the confidence of the most confident plane that finds it; −1 where none does."""
    right = near(row.planes, row.true, *RIGHT)
    return np.where(right, row.planes.confidences[:, None], -1.0).max(axis=0, initial=-1.0)


def time_grid(rows: dict[str, list[Row]]) -> Grid:
    """Median CPU seconds of a cloud, over all and at 8,000 points as they are."""
    lines = []
    for title, kept in (("all clouds", None), ("8,000 points as they are", "P0")):
        seconds = [[row.seconds for row in rows[m] if kept in (None, row.condition)] for m in rows]
        lines.append([Text(title), *(Text(f"{np.median(each):.2f}" if each else "–") for each in seconds)])
    return Grid("CPU seconds a cloud, median", ["clouds", *rows], lines)


def object_grid(objects: Sequence[dict], scored: dict) -> Grid:
    """The objects, and each method's share of found planes (of those without any, false planes) over all conditions."""
    rows = []
    for each in objects:
        key = "found" if each["planes"] else "false"
        means = [mean([s for (name, _), s in scored[m].items() if name == each["name"]], key) for m in scored]
        cells = ["–" if np.isnan(value) else f"{value:.2f}" + ("" if each["planes"] else " false") for value in means]
        planes = f"{len(each['planes'])}" + (f" (+{len(each['nearly'])})" if each["nearly"] else "")
        rows.append([Text(text) for text in (each["name"], each["what"], f"`{each['file']}`", planes, *cells)])
    return Grid("Found over all conditions", ["object", "what", "file", "planes (+ nearly)", *scored], rows, left=3)


def made_by(rows: dict[str, list[Row]], objects: int) -> str:
    """A line for each method: its clouds and the code they were made with."""
    lines = []
    for method, each in rows.items():
        codes = {(row.code["version"], str(row.code["commit"])[:9], "*" * bool(row.code["modified"])) for row in each}
        named = ", ".join(f"{release} at {commit}{star}" for release, commit, star in sorted(codes))
        asked = objects * len(OF_MESHES.get(method, CONDITIONS))
        lines.append(f"- {method}: {len(each):,} of {asked:,} clouds, symshrec {named}\n")
    machine = hardware()
    lines.append(f"\nPage written on {machine['cpu']}, {machine['cores']} cores; trimesh {version('trimesh')}. ")
    return "".join(lines) + "A star: files of the package were changed since that commit.\n"


def _about(packages: dict, objects: Sequence[dict]) -> str:
    """The packages' licences, and those that an object's own folder states."""
    lines = [f"- {name} {each['version']}: {each['licence']}" for name, each in packages.items()]
    lines += [f"- of that, {each['name']}: {each['licence']}" for each in objects if "licence" in each]
    return "\n".join(lines) + "\n"
