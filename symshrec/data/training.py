"""What a training reads: sampled points and true planes, in batches, from memory, a mapped file or the generator."""

import hashlib
import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from safetensors import SafetensorError, safe_open
from torch.utils.data import Dataset
from tqdm import tqdm

from symshrec.benchmark.stream import CloudStream
from symshrec.data.batch import SampledBatch
from symshrec.data.samples import CachedSamples, drawn
from symshrec.data.settings import SamplingSettings
from symshrec.files.atomic import atomic_writer, require_room, write_atomically
from symshrec.files.tensors import save

POINT = 12  # bytes of three float32
TRUTH = ("normals", "counts", "centres")


class SampledDataset(Dataset):
    """The sampled points and true planes of the clouds at `positions` of a split, in memory: whole batches at once."""

    def __init__(self, split, positions: np.ndarray, samples: CachedSamples, progress: bool = True):
        points = np.empty((len(positions), samples.sampling.points, 3), np.float32)
        truth = []
        shown = tqdm(positions, unit="cloud", desc="training clouds", disable=not progress, leave=False)
        for row, position in enumerate(shown):
            cloud = split[int(position)]
            points[row] = cloud.points[samples[position]]
            truth.append(cloud.planes)
        self.clouds = SampledBatch.of(torch.from_numpy(points), truth)

    def __len__(self) -> int:
        return len(self.clouds)

    def __getitem__(self, rows: list[int]) -> SampledBatch:
        return self.clouds[torch.tensor(rows)]


class MappedDataset(Dataset):
    """The same, the points in a file that is mapped: of a split larger than memory, what a step needs is read for it.

    Args:
        positions: (R,) of the split's clouds that count.
        points: (C, n, 3) float32, of all its clouds, mapped. truth: of all its clouds, without points.
    """

    def __init__(self, positions: np.ndarray, points: np.ndarray, truth: SampledBatch):
        self.positions, self.points, self.truth = positions, points, truth

    def __len__(self) -> int:
        return len(self.positions)

    def __getitem__(self, rows: list[int]) -> SampledBatch:
        places = self.positions[rows]
        return replace(self.truth[torch.from_numpy(places)], points=torch.from_numpy(self.points[places]))


class StreamedDataset(Dataset):
    """Clouds of a stream with their samples, made in the process that asks for them; an epoch's number is its length.

    Samples are drawn on the CPU whatever the device, so that they are the same for every number of processes.
    """

    def __init__(self, stream: CloudStream, sampling: SamplingSettings, seed: int):
        self.stream, self.sampling, self.seed = stream, sampling, seed

    def __len__(self) -> int:
        return self.stream.epoch_clouds

    def __getitem__(self, numbers: list[int]) -> SampledBatch:
        clouds = [self.stream[number] for number in numbers]
        points = [np.asarray(cloud.points, dtype=np.float32) for cloud in clouds]
        indices = drawn(points, numbers, self.sampling, self.seed)
        sampled = np.stack([each[chosen] for each, chosen in zip(points, indices, strict=True)])
        return SampledBatch.of(torch.from_numpy(sampled), [cloud.planes for cloud in clouds])


def fits_memory(clouds: int, points: int) -> bool:
    """Whether the sampled points of so many clouds fill less than a quarter of the machine's memory."""
    memory = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    return clouds * points * POINT < memory / 4


def mapped_clouds(
    split, samples: CachedSamples, verify: bool = True, progress: bool = True
) -> tuple[np.ndarray, SampledBatch]:
    """The sampled points of all clouds of a split as a mapped file beside the samples, made where it is missing.

    It takes 12 bytes a point, is written in one pass, and counts only with its second file, which holds the planes and
    is written after it; a killed run begins the pass again.

    Args:
        split: C clouds, read in order. samples: theirs.
        verify: compare the points with the sha256 of what was written (about 1 s per 2 GB), and make them again where
            they differ.

    Returns:
        (C, n, 3) float32, mapped, and the planes of all clouds as a batch without points.

    Raises:
        DiskFullError: where it does not fit.
    """
    shape = (len(split), samples.sampling.points, 3)
    path = samples.folder / f"points-{samples.sampling.kind.name}-{shape[1]}.bin"
    truth = _read_truth(path, shape, samples.digest, verify)
    if truth is None:
        truth = _write(path, shape, split, samples, progress)
    return np.memmap(path, np.float32, "r", shape=shape), truth


def _write(path: Path, shape: tuple[int, ...], split, samples: CachedSamples, progress: bool) -> SampledBatch:
    size = int(np.prod(shape)) * 4
    require_room(path.parent, size)
    path.with_suffix(".safetensors").unlink(missing_ok=True)
    truth, written = [], hashlib.sha256()
    with atomic_writer(path, size) as file:
        for position in tqdm(range(shape[0]), unit="cloud", desc="mapped clouds", disable=not progress, leave=False):
            cloud = split[position]
            sampled = np.asarray(cloud.points[samples[position]], np.float32)
            file.write(sampled.data)
            written.update(sampled.data)
            truth.append(cloud.planes)
    batch = SampledBatch.of(torch.empty(len(truth), 0, 3), truth)
    arrays = {name: getattr(batch, name).numpy() for name in TRUTH}
    known = {"digest": samples.digest, "truth": _digest(arrays), "points": written.hexdigest()}
    write_atomically(path.with_suffix(".safetensors"), save(arrays, known))
    return batch


def _read_truth(path: Path, shape: Sequence[int], digest: str, verify: bool) -> SampledBatch | None:
    """The planes beside the points at `path`; None where either is missing, another's or damaged."""
    try:
        if path.stat().st_size != int(np.prod(shape)) * 4:
            return None
        with safe_open(path.with_suffix(".safetensors"), framework="numpy") as file:
            metadata = file.metadata() or {}
            arrays = {name: file.get_tensor(name) for name in TRUTH}
    except (FileNotFoundError, SafetensorError, UnicodeDecodeError):
        return None
    if metadata.get("digest") != digest or metadata.get("truth") != _digest(arrays):
        return None
    if verify and metadata.get("points") != _file_digest(path):
        return None
    return SampledBatch(torch.empty(shape[0], 0, 3), **{name: torch.from_numpy(each) for name, each in arrays.items()})


def _file_digest(path: Path) -> str:
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _digest(arrays: dict[str, np.ndarray]) -> str:
    found = hashlib.sha256()
    for name in TRUTH:
        found.update(np.ascontiguousarray(arrays[name]).data)
    return found.hexdigest()
