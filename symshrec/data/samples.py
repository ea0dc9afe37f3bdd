"""Point samples of a split, drawn once and kept beside its clouds."""

import hashlib
from pathlib import Path

import numpy as np
import torch
from safetensors import SafetensorError, safe_open
from tqdm import tqdm

from symshrec.data.settings import SamplingKind
from symshrec.files.atomic import write_atomically
from symshrec.files.tensors import save
from symshrec.geometry.sampling import farthest_point_sampling

CHUNK = 256
BATCH = 16  # clouds at once on the CPU; a GPU takes a chunk


def cached_samples(clouds, kind: SamplingKind, count: int, seed: int, folder: Path, key: str, progress: bool = True):
    """Indices of the sampled points of every cloud of a split, computed where missing, a chunk of clouds at a time.

    Args:
        clouds: C clouds, each with `points` (N, 3), read in order.
        kind: `farthest` or `random`; both depend on a cloud and its place only.
        count: points a cloud; a smaller cloud repeats points.
        seed: of the random choice.
        folder: where the chunks are kept; a chunk is written whole or not at all, so a killed run goes on where it was.
        key: names the clouds' content; chunks made for other clouds are drawn again.

    Returns:
        (C, count) uint32.
    """
    folder.mkdir(parents=True, exist_ok=True)
    digest = hashlib.sha256(f"{kind.name} {count} {seed} {key}".encode()).hexdigest()
    chunks = []
    bar = tqdm(total=len(clouds), unit="cloud", desc=f"{kind.name} samples", disable=not progress, leave=False)
    for start in range(0, len(clouds), CHUNK):
        stop = min(start + CHUNK, len(clouds))
        path = folder / f"{kind.name}-{count}-{start:06d}.safetensors"
        indices = _read_chunk(path, digest)
        if indices is None or indices.shape != (stop - start, count) or indices.dtype != np.uint32:
            indices = _draw(clouds, range(start, stop), kind, count, seed)
            checked = {"digest": digest, "sha256": hashlib.sha256(indices.data).hexdigest()}
            write_atomically(path, save({"indices": indices}, checked))
        chunks.append(indices)
        bar.update(stop - start)
    bar.close()
    return np.concatenate(chunks) if chunks else np.zeros((0, count), np.uint32)


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


def _draw(clouds, positions: range, kind: SamplingKind, count: int, seed: int) -> np.ndarray:
    drawn, device = [], "cuda" if torch.cuda.is_available() else "cpu"
    size = CHUNK if device == "cuda" else BATCH
    for start in range(positions.start, positions.stop, size):
        batch = range(start, min(start + size, positions.stop))
        points = [np.asarray(clouds[position].points, dtype=np.float32) for position in batch]
        if kind is SamplingKind.farthest:
            lengths = torch.tensor([len(each) for each in points])
            together = torch.from_numpy(np.concatenate(points)).to(device)
            drawn.append(farthest_point_sampling(together, lengths.to(device), count).cpu().numpy())
        else:
            chosen = [_random(len(each), count, (seed, at)) for each, at in zip(points, batch, strict=True)]
            drawn.append(np.stack(chosen))
    return np.concatenate(drawn).astype(np.uint32)


def _random(length: int, count: int, seed: tuple[int, int]) -> np.ndarray:
    generator = np.random.default_rng(np.random.SeedSequence(seed))
    return generator.choice(length, count, replace=length < count)
