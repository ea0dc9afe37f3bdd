"""M4, our training-free detector: one cloud in, its mirror planes out."""

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from symshrec.methods.alignment import align, mirrored, moved, step
from symshrec.methods.m4.search import direction_scores, hemisphere, local_maxima
from symshrec.methods.m4.volume import OUTSIDE, density_volume, look_up, nearest_volume
from symshrec.methods.surface import local_surface
from symshrec.planes import Planes


@dataclass(frozen=True)
class M4Settings:
    points: int = 8192
    directions: int = 1500
    search_points: int = 300
    candidates: int = 40
    coarse_points: int = 400
    neighbours: int = 16


def canonical_order(points: np.ndarray) -> np.ndarray:
    """Indices that put (N, 3) float64 points in a random-looking order that depends on their coordinates alone."""
    bits = (points + 0.0).view(np.uint64)
    mixed = np.zeros(len(points), np.uint64)
    for axis in range(3):
        mixed = (mixed ^ bits[:, axis]) * np.uint64(0x9E3779B97F4A7C15)
        mixed ^= mixed >> np.uint64(29)
    return mixed


def coarse(surface, volume, half, size, normals, offsets, queries, scales):
    points, normals_of = surface.points[queries], surface.normals[queries]
    ones = torch.ones(len(points))
    for scale in scales:
        nearest = look_up(volume, mirrored(points, normals, offsets), half, size)
        there = (nearest != OUTSIDE).float()
        nearest = nearest.clamp_min(0)
        move, basis, weights, residual, _ = step(points, normals_of, ones, surface.points[nearest],
            surface.normals[nearest], there, normals, offsets, scale, 1e-3)
        normals, offsets = moved(normals, offsets, move, basis)
    return normals, offsets, weights.mean(1)


def distinct(normals, scores, separation):
    order = torch.argsort(scores, descending=True, stable=True)
    cosine = (normals[order] @ normals[order].T).abs() > np.cos(np.deg2rad(separation))
    kept = []
    for row in range(len(order)):
        if not cosine[row, kept].any():
            kept.append(row)
    return order[kept]


def detect(points: np.ndarray, settings=M4Settings(), clock=None):
    import time
    marks = [time.perf_counter()]
    tick = lambda: marks.append(time.perf_counter())
    points = np.asarray(points, np.float64)
    centre = points.mean(0)
    scale = float(np.sqrt(12 * np.square(points - centre).sum(1).mean()))
    order = np.argsort(canonical_order(points), kind="stable")[: settings.points]
    cloud = torch.from_numpy(((points[order] - centre) / scale).astype(np.float32))
    half = float(cloud.abs().max().clamp_max(1.0)) * 1.1
    tick()
    surface = local_surface(cloud, settings.neighbours, (0.02, 0.01, 0.005, 0.0025, 0.0015))
    tick()
    size = 48
    volume = density_volume(cloud, half, size, 0.03)
    queries = cloud[: settings.search_points]
    weights = 1 - look_up(volume, queries, half, size)
    directions, around = hemisphere(settings.directions)
    scores = direction_scores(volume, queries, weights, directions, torch.zeros(1), half, size)[:, 0]
    tick()
    peaks = local_maxima(scores, around, settings.candidates)
    normals, offsets = directions[peaks], torch.zeros(len(peaks))
    nearest = nearest_volume(cloud[:2048], half, 48, 2)
    tick()
    normals, offsets, matched = coarse(surface, nearest, half, 48, normals, offsets,
        torch.arange(min(len(cloud), settings.coarse_points)), (0.05, 0.05, 0.05, 0.04, 0.04, 0.03, 0.03, 0.02, 0.02, 0.02))
    kept = distinct(normals, matched, 4.0)
    kept = kept[matched[kept] > 0.4 * matched.max()][:20]
    normals, offsets, matched = normals[kept], offsets[kept], matched[kept]
    tick()
    normals, offsets, _ = align(surface, normals, offsets, torch.arange(min(len(cloud), 1200)), (0.015, 0.01, 0.006))
    tick()
    normals, offsets, _ = align(surface, normals, offsets, torch.arange(len(cloud)), (0.003, 0.0015))
    tick()
    if clock is not None:
        clock.append(np.diff(marks))
    n, d = normals.double().numpy(), offsets.double().numpy()
    return Planes(n, n * d[:, None], matched.numpy()).transformed(scale=scale, translation=centre)
