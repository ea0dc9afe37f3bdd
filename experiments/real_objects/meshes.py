"""Real objects as the benchmark's surfaces: a mesh's triangles, points drawn evenly on them."""

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh

from symshrec.benchmark.surfaces import Surface

OBJECTS = Path(__file__).parents[1] / "real_objects.json"
DIAGONAL = 3.6  # of every object's box, the median of the benchmark's clouds, so that P1–P9 are as strong as there
UPRIGHT = {
    "x": np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]]),
    "y": np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]]),
    "z": np.eye(3),
}  # rotations that turn a file's upward axis to z


@dataclass(frozen=True)
class Entry:
    """A file of a package, and which of its axes points up."""

    name: str
    package: str
    file: str
    up: str = "z"


class MeshSurface(Surface):
    """Triangles (F, 3, 3); a place is (share along the first edge, share along the second, triangle)."""

    bounds = ((0.0, 1.0), (0.0, 1.0))

    def __init__(self, triangles: np.ndarray):
        edges = triangles[:, 1:] - triangles[:, :1]
        across = np.cross(edges[:, 0], edges[:, 1])
        doubled = np.linalg.norm(across, axis=1)
        kept = doubled > 0
        self.triangles, self.edges = triangles[kept], edges[kept]
        self.faces = across[kept] / doubled[kept, None]
        self.until = np.cumsum(doubled[kept] / doubled.sum())

    def draw(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """Random places, (count, 3), independent and uniform by area."""
        chosen = np.searchsorted(self.until, rng.random(count), side="right").clip(max=len(self.until) - 1)
        a, b = rng.random((2, count))
        outside = a + b > 1  # the other half of the parallelogram, folded back
        return np.stack([np.where(outside, 1 - a, a), np.where(outside, 1 - b, b), chosen], axis=1)

    def points(self, chart: np.ndarray) -> np.ndarray:
        """The points (N, 3) at places (N, 3)."""
        rows = chart[:, 2].astype(int)
        return self.triangles[rows, 0] + np.einsum("ne,ned->nd", chart[:, :2], self.edges[rows])

    def normals(self, chart: np.ndarray) -> np.ndarray:
        """The triangles' unit normals (N, 3) at places (N, 3)."""
        return self.faces[chart[:, 2].astype(int)]


@dataclass(frozen=True, eq=False)
class Frame:
    """The way from a file's coordinates to ours, x ↦ scale · rotation x + translation: z up, the box's centre at 0."""

    rotation: np.ndarray
    translation: np.ndarray
    scale: float


def read(packages: Path, entry: Entry) -> tuple[MeshSurface, Frame, str]:
    """A file's surface in our frame, the way there, and the file's sha256.

    Raises:
        ValueError: where the file is missing or holds no triangles, saying what to do.
    """
    path = packages / entry.file
    if not path.is_file():
        raise ValueError(
            f"{path} is missing; install the packages: pip install --no-deps --require-hashes --only-binary :all: "
            f"--target {packages} -r experiments/real_meshes.txt"
        )
    mesh = trimesh.load(path, force="mesh", process=False)
    if not len(getattr(mesh, "faces", ())):
        raise ValueError(f"{path} holds no triangles; take it out of {OBJECTS.name}")
    triangles = np.asarray(mesh.triangles, dtype=np.float64) @ UPRIGHT[entry.up].T
    low, high = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
    scale = DIAGONAL / float(np.linalg.norm(high - low))
    translation = -scale * (low + high) / 2
    frame = Frame(UPRIGHT[entry.up], translation, scale)
    return MeshSurface(scale * triangles + translation), frame, hashlib.sha256(path.read_bytes()).hexdigest()


def listed(path: Path = OBJECTS) -> dict:
    """What experiments/real_objects.json holds: the packages' licences, and the objects with their true planes."""
    return json.loads(path.read_text(encoding="utf-8"))
