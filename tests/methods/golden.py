"""The planes that every method is known to give: `python -m tests.methods.golden` writes them to golden.json anew.

An entry belongs to a method's `version` (and to its weights). Planes that change while the version stays are a fault,
or a change that has to be declared: raise the version, so that no stored run is taken for one of the new code.
"""

import hashlib
import json
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from itertools import islice
from pathlib import Path

import numpy as np
import torch
from scipy.optimize import linear_sum_assignment

from symshrec.api import named_method
from symshrec.benchmark.config import BenchmarkConfig, SplitConfig
from symshrec.benchmark.generate import generate_cloud
from symshrec.files.threads import one_thread
from symshrec.geometry.rotations import axis_rotation
from symshrec.methods import fit
from symshrec.methods.baselines.module import PcaIcp, Ransac
from symshrec.methods.m1.module import M1
from symshrec.methods.m2.module import M2
from symshrec.methods.m3.module import M3
from symshrec.methods.m4.module import M4
from symshrec.methods.weights import read_weights
from symshrec.planes import Planes

FILE = Path(__file__).with_suffix(".json")
COMMAND = "python -m tests.methods.golden"
SPLIT, PLACES = "train", (14, 15, 23, 27, 30, 34)
GRID = 2.0**-13  # to which coordinates are rounded, since processors differ in the last digit of a cosine
DECIMALS = 9


@dataclass(frozen=True)
class Golden:
    """One entry: a method at its published settings, how exactly its planes are the same on all processors, and what
    declares that they changed.

    planes: of points (N, 3) float32 and the cloud's true planes. weights: shipped ones, whose content names the entry.
    clouds: how many of them, the first; fewer where a method takes its time.
    """

    title: str
    planes: Callable[[torch.Tensor, Planes], Planes]
    tolerance: float
    version: int
    declared_in: str
    weights: str | None = None
    clouds: int = len(PLACES)

    @property
    def key(self) -> str:
        """The title, with the weights' sha256 where there are any."""
        return f"{self.title}, weights {read_weights(self.weights).sha256[:16]}" if self.weights else self.title


def entries() -> list[Golden]:
    """The methods whose planes are kept."""

    def detected(name: str, **arguments):
        def planes(points: torch.Tensor, truth: Planes) -> Planes:
            method = named_method(name, **arguments)
            return (method.eval() if isinstance(method, torch.nn.Module) else method).detect(points)

        return planes

    def refined(points: torch.Tensor, truth: Planes) -> Planes:
        return fit.refined(points, truth.transformed(axis_rotation(0, np.deg2rad(2)), [0.01, 0.02, -0.01]))

    # Tolerances: with and without AVX2, planes of M1 differ by 2e-5, of M3 and the baselines not at all, of M4 and
    # refinement by 4e-6.
    networks = (("M1 (R4)", "m1", "m1_r4", M1), ("M2", "m2", "m2", M2))
    free = (("M3 (R1)", "m3", 1e-6, M3), ("M4", "m4", 1e-3, M4))  # PyTorch 2.4 rounds by up to 5e-4 otherwise
    baselines = (("PCA + ICP", "pca_icp", PcaIcp), ("RANSAC + ICP", "ransac", Ransac))
    return [
        *(
            Golden(title, detected(name, weights=[weights]), 1e-3, _version(kind), f"{kind.__name__}.version", weights)
            for title, name, weights, kind in networks
        ),
        *(
            Golden(title, detected(name), tolerance, _version(kind), f"{kind.__name__}.version")
            for title, name, tolerance, kind in free
        ),
        *(
            Golden(title, detected(name), 1e-6, _version(kind), f"{kind.__name__}.version", clouds=2)
            for title, name, kind in baselines
        ),
        Golden("refinement", refined, 3e-5, getattr(fit, "REFINEMENT_VERSION", 1), "fit.REFINEMENT_VERSION"),
    ]


@cache
def clouds() -> dict[str, tuple[torch.Tensor, Planes]]:
    """Name: points (N, 3) float32 and true planes, of a few clouds of a training split."""
    config, made = BenchmarkConfig(splits={SPLIT: SplitConfig(42)}), {}
    for place in PLACES:
        cloud = generate_cloud(config, SPLIT, place)
        points = np.round(cloud.points.astype(np.float64) / GRID) * GRID
        digest = hashlib.sha256(points.astype(np.float32).tobytes()).hexdigest()[:16]
        name = f"{cloud.labels.family} {cloud.labels.solid} {cloud.labels.perturbation} {digest}"
        made[name] = torch.from_numpy(points.astype(np.float32)), cloud.planes
    return made


def found(entry: Golden) -> dict[str, list[list[float]]]:
    """The planes of every cloud as rows [nx, ny, nz, offset, confidence]."""
    with one_thread(), torch.no_grad():
        return {name: _rows(entry.planes(*cloud)) for name, cloud in islice(clouds().items(), entry.clouds)}


def moved(rows: list, expected: list) -> float:
    """The largest difference of a component, an offset or a confidence; infinite where the planes are not as many."""
    if len(rows) != len(expected):
        return float("inf")
    if not rows:
        return 0.0
    ours, theirs = (np.array(each) for each in (rows, expected))
    flipped = ours * [-1, -1, -1, -1, 1]  # a normal has no sign
    gaps = np.minimum(*(np.abs(each[:, None] - theirs).max(axis=2) for each in (ours, flipped)))
    return float(gaps[linear_sum_assignment(gaps)].max())


def faults(entry: Golden, stored: dict) -> list[str]:
    """What is wrong with an entry, one sentence each, and what to do; empty where its planes are as stored."""
    if entry.key not in stored:
        return [f"golden.json has no {entry.key}; run `{COMMAND}`"]
    kept = stored[entry.key]
    if kept["version"] != entry.version:
        return [f"{entry.declared_in} is {entry.version}, golden.json has version {kept['version']}; run `{COMMAND}`"]
    planes = found(entry)
    if planes.keys() != kept["clouds"].keys():
        return [f"the generated clouds are not those of golden.json; run `{COMMAND}`"]
    gaps = {name: moved(rows, kept["clouds"][name]) for name, rows in planes.items()}
    return [
        f"{entry.title} on {name}: {_described(gap, rows, kept['clouds'][name])}, and {entry.declared_in} is still "
        f"{entry.version}; raise {entry.declared_in} and run `{COMMAND}`"
        for (name, rows), gap in zip(planes.items(), gaps.values(), strict=True)
        if gap > entry.tolerance
    ]


def main() -> None:
    """Write golden.json anew, unless planes changed without their version."""
    stored = json.loads(FILE.read_text()) if FILE.exists() else {}
    undeclared, fresh = [], {}
    for entry in entries():
        complaints = faults(entry, stored)
        undeclared += [each for each in complaints if f"raise {entry.declared_in}" in each]
        kept = stored.get(entry.key) if not complaints else None  # what holds stays to the last digit
        fresh[entry.key] = kept or {"version": entry.version, "clouds": found(entry)}
        print(f"{entry.key}: {'as it was' if kept else 'new'}")
    if undeclared:
        sys.exit("\n".join(undeclared))
    FILE.write_text(_text(fresh))


def _version(kind: type) -> int:
    return getattr(kind, "version", None) or 1


def _rows(planes: Planes) -> list[list[float]]:
    columns = np.hstack([planes.normals, planes.offsets[:, None], planes.confidences[:, None]])
    return np.round(columns, DECIMALS).tolist()


def _described(gap: float, rows: list, expected: list) -> str:
    return f"planes moved by {gap:.1e}" if np.isfinite(gap) else f"{len(rows)} planes in place of {len(expected)}"


def _text(content: dict) -> str:
    """JSON with a plane a line."""
    lines = []
    for key, entry in content.items():
        named = [
            f"   {json.dumps(name)}: [" + ",".join(f"\n    {json.dumps(row)}" for row in rows) + "]"
            for name, rows in entry["clouds"].items()
        ]
        clouds_text = ",\n".join(named)
        lines.append(f' {json.dumps(key)}: {{"version": {entry["version"]}, "clouds": {{\n{clouds_text}}}}}')
    return "{\n" + ",\n".join(lines) + "\n}\n"


if __name__ == "__main__":
    main()
