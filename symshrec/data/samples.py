"""Point samples of a split, drawn once and kept beside its clouds."""

import hashlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from safetensors import SafetensorError, safe_open
from tqdm import tqdm

from symshrec.data.settings import SamplingKind, SamplingSettings
from symshrec.files.atomic import write_atomically
from symshrec.files.tensors import save
from symshrec.geometry.sampling import farthest_point_sampling

CHUNK = 256
BATCH = 16  # clouds at once on the CPU; a GPU takes a chunk


class CachedSamples:
    """Indices of the sampled points of every cloud of a split, in files of `CHUNK` clouds beside the clouds.

    What is missing is drawn first. Then a file is read when one of its clouds is asked for, and the last one kept, so
    that the samples of a large split need no memory. A file is written whole or not at all: a killed run goes on where
    it was. One that is damaged, or made for other clouds, is drawn again.

    Args:
        clouds: C clouds, each with `points` (N, 3).
        sampling: kind and number of points; a smaller cloud repeats points. Samples depend on a cloud and its place
            only.
        seed: of the random choice. folder: where the files lie.
        key: names the clouds' content.
        progress: show a bar while samples are drawn.
    """

    def __init__(self, clouds, sampling: SamplingSettings, seed: int, folder: Path, key: str, progress: bool = True):
        self.clouds, self.sampling, self.seed, self.folder = clouds, sampling, seed, folder
        text = f"{sampling.kind.name} {sampling.points} {seed} {key}"
        self.digest = hashlib.sha256(text.encode()).hexdigest()
        self._start, self._indices = -1, np.empty((0, sampling.points), np.uint32)
        folder.mkdir(parents=True, exist_ok=True)
        kind = sampling.kind.name
        with tqdm(total=len(clouds), unit="cloud", desc=f"{kind} samples", disable=not progress, leave=False) as bar:
            for start in range(0, len(clouds), CHUNK):
                bar.update(len(self._chunk(start)))

    def __len__(self) -> int:
        return len(self.clouds)

    def __getitem__(self, position: int) -> np.ndarray:
        """The sampled points of one cloud: indices into its points, (n,) uint32."""
        start = int(position) // CHUNK * CHUNK
        if start != self._start:
            self._start, self._indices = start, self._chunk(start)
        return self._indices[int(position) - start]

    def __getstate__(self) -> dict:
        return self.__dict__ | {"_start": -1, "_indices": self._indices[:0]}

    def _chunk(self, start: int) -> np.ndarray:
        stop, count = min(start + CHUNK, len(self.clouds)), self.sampling.points
        path = self.folder / f"{self.sampling.kind.name}-{count}-{start:06d}.safetensors"
        indices = _read_chunk(path, self.digest)
        if indices is None or indices.shape != (stop - start, count) or indices.dtype != np.uint32:
            indices = _draw(self.clouds, range(start, stop), self.sampling, self.seed)
            checked = {"digest": self.digest, "sha256": hashlib.sha256(indices.data).hexdigest()}
            write_atomically(path, save({"indices": indices}, checked))
        return indices


def drawn(
    points: Sequence[np.ndarray], places: Sequence[int], sampling: SamplingSettings, seed: int, device: str = "cpu"
) -> np.ndarray:
    """Indices of sampled points of some clouds.

    Args:
        points: of B clouds, each (N, 3) float32. places: of the clouds in their split, for the random choice.

    Returns:
        (B, n) uint32.
    """
    if sampling.kind is SamplingKind.farthest:
        lengths = torch.tensor([len(each) for each in points])
        together = torch.from_numpy(np.concatenate(points)).to(device)
        return farthest_point_sampling(together, lengths.to(device), sampling.points).cpu().numpy().astype(np.uint32)
    chosen = [_random(len(each), sampling.points, (seed, at)) for each, at in zip(points, places, strict=True)]
    return np.stack(chosen).astype(np.uint32)


def _read_chunk(path: Path, digest: str) -> np.ndarray | None:
    """A chunk's indices; None where it is missing, another's or damaged."""
    try:
        with safe_open(path, framework="numpy") as file:
            metadata, indices = file.metadata() or {}, file.get_tensor("indices")
    except (FileNotFoundError, SafetensorError, UnicodeDecodeError):
        return None
    whole = hashlib.sha256(indices).hexdigest()
    known = metadata.get("digest") == digest and metadata.get("sha256", whole) == whole  # once, it was not kept
    return indices if known and indices.dtype == np.uint32 and indices.ndim == 2 else None


def _draw(clouds, positions: range, sampling: SamplingSettings, seed: int) -> np.ndarray:
    parts, device = [], "cuda" if torch.cuda.is_available() else "cpu"
    size = CHUNK if device == "cuda" else BATCH
    for start in range(positions.start, positions.stop, size):
        batch = range(start, min(start + size, positions.stop))
        points = [np.asarray(clouds[position].points, dtype=np.float32) for position in batch]
        parts.append(drawn(points, batch, sampling, seed, device))
    return np.concatenate(parts)


def _random(length: int, count: int, seed: tuple[int, int]) -> np.ndarray:
    generator = np.random.default_rng(np.random.SeedSequence(seed))
    return generator.choice(length, count, replace=length < count)
