"""What is compared: M4 and the baselines as `symshrec.detect` gives them, pyclarcs, and what trimesh says of a mesh."""

import json
import os
import struct
import subprocess
import sys
import time
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path

import numpy as np
import trimesh

import symshrec
from experiments.real_objects import clarcs
from experiments.real_objects.meshes import MeshSurface
from symshrec.methods.registry import method_class
from symshrec.planes import Planes
from symshrec.runs.config import load, settings_of
from symshrec.runs.identity import decisive_settings, method_identity

OURS = ("m4", "pca_icp", "ransac")
METHODS = (*OURS, "pyclarcs", "trimesh")
OF_MESHES = {"trimesh": ("P0",)}  # the conditions that a method for meshes has
CLARCS_POINTS = 4000  # of a larger cloud, drawn at random: its time grows with their square (its examples have 5,000)
INSTALL = (
    "pip install --no-deps --require-hashes --only-binary :all: --target {folder} -r experiments/real_pyclarcs.txt"
)
Detect = Callable[[np.ndarray, MeshSurface, np.ndarray], tuple[Planes, float]]


def opened(name: str, clarcs_folder: Path) -> tuple[Detect, dict]:
    """A method as a function of a cloud (N, 3), its object's surface and the rotation between, and what identifies it.

    The function gives planes and CPU seconds. Planes of methods without a confidence have confidence 1.

    Raises:
        ValueError: for a method that is not there, saying how to install it.
    """
    if name in OURS:
        method = method_class(name)(settings_of(load([f"method={name}"]).method))
        identity = {"code": method_identity(method), "settings": decisive_settings(method.settings)}
        return lambda points, surface, turn: _ours(name, points), json.loads(json.dumps(identity, default=str))
    if name == "pyclarcs":
        worker = Clarcs(clarcs_folder)
        return lambda points, surface, turn: worker(points), {"version": worker.version, "points": CLARCS_POINTS}
    return _inertia, {"version": version("trimesh")}


def _ours(name: str, points: np.ndarray) -> tuple[Planes, float]:
    start = time.process_time()
    planes = symshrec.detect(points, name, min_confidence=0.0)
    return planes, time.process_time() - start


def _inertia(points: np.ndarray, surface: MeshSurface, turn: np.ndarray) -> tuple[Planes, float]:
    """The three planes across the mesh's principal axes of inertia, through its centre of mass.

    trimesh knows no mirror planes; its `symmetry` names rotational symmetry, from the same axes.
    """
    start = time.process_time()
    mesh = trimesh.Trimesh(surface.triangles.reshape(-1, 3), np.arange(3 * len(surface.triangles)).reshape(-1, 3))
    normals = mesh.principal_inertia_vectors
    planes = Planes(normals, np.tile(mesh.center_mass, (3, 1)))
    return planes.transformed(turn), time.process_time() - start


class Clarcs:
    """pyclarcs in a process of its own, kept open between clouds: its packages are not on our path."""

    def __init__(self, folder: Path):
        if not (folder / "pyclarcs").is_dir():
            raise ValueError(f"pyclarcs is not in {folder}; {INSTALL.format(folder=folder)}")
        one = {name: "1" for name in ("OMP_NUM_THREADS", "NUMBA_NUM_THREADS", "OPENBLAS_NUM_THREADS")}
        command = [sys.executable, str(Path(clarcs.__file__))]
        environment = {**os.environ, **one, "PYTHONPATH": str(folder)}
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment)
        self.version = self._answer()["version"]

    def __call__(self, points: np.ndarray) -> tuple[Planes, float]:
        """The one plane of a cloud (N, 3), and CPU seconds."""
        assert self.process.stdin is not None
        if len(points) > CLARCS_POINTS:
            points = points[np.random.default_rng(0).choice(len(points), CLARCS_POINTS, replace=False)]
        self.process.stdin.write(struct.pack("<q", len(points)) + np.ascontiguousarray(points, "<f8").tobytes())
        self.process.stdin.flush()
        answer = self._answer()
        normal = np.array(answer["normal"])
        return Planes(normal[None], answer["offset"] * normal[None]), answer["seconds"]

    def _answer(self) -> dict:
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        if not line:
            raise ValueError("pyclarcs ended early; its own message stands above")
        return json.loads(line)
