"""M4, our training-free detector: one cloud in, its mirror planes out."""

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from symshrec.methods.alignment import Pairs, align, mirrored, moved
from symshrec.methods.coupling import closure, find_relations
from symshrec.methods.ends import end_offset
from symshrec.methods.misfit import misfit
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
    neighbours: int = 12
    coupled: bool = True
    fine_points: int = 1200
    middle_points: int = 600
    final_points: int = 8192
    pruned: float = 0.6
    good: float = 0.22
    surface_scales: tuple = (0.02, 0.02, 0.01, 0.005, 0.003)
    coarse_scales: tuple = (0.05, 0.05, 0.05, 0.04, 0.04, 0.03, 0.03, 0.02, 0.02, 0.02)
    middle_scales: tuple = (0.015, 0.01)
    group_stages: tuple = ((0.015, 5.0), (0.01, 4.0), (0.007, 3.0), (0.005, 2.0))
    final_scales: tuple = (0.0035, 0.002)


def canonical_order(points: np.ndarray) -> np.ndarray:
    """Keys that put (N, 3) float64 points in a random-looking order that depends on their coordinates alone."""
    bits = (points + 0.0).view(np.uint64)
    mixed = np.zeros(len(points), np.uint64)
    for axis in range(3):
        mixed = (mixed ^ bits[:, axis]) * np.uint64(0x9E3779B97F4A7C15)
        mixed ^= mixed >> np.uint64(29)
    return mixed


def coarse(surface, volume, half, size, normals, offsets, queries, scales):
    for scale in scales:
        nearest = look_up(volume, mirrored(surface.points[queries], normals, offsets), half, size)
        pairs = Pairs(surface, queries, nearest.clamp_min(0), (nearest != OUTSIDE).float())
        normals, offsets, _ = moved(pairs, normals, offsets, scale, 1e-3)
    return normals, offsets


def distinct(normals, scores, separation):
    """Rows by descending score, each over `separation` degrees from those before it."""
    order = torch.argsort(scores, descending=True, stable=True)
    close = (normals[order] @ normals[order].T).abs() > np.cos(np.deg2rad(separation))
    kept = []
    for row in range(len(order)):
        if not close[row, kept].any():
            kept.append(row)
    return order[kept]


def with_ends(surface, normals, offsets, blind):
    offsets = offsets.clone()
    for row in torch.nonzero(blind)[:, 0].tolist():
        offsets[row] = end_offset(surface.points @ normals[row], surface.certainty.sqrt()).float()
    return offsets


def regrouped(surface, normals, offsets, queries, scale, tolerance, settings):
    """Completed by images, aligned together, repetitions and failures removed."""
    more, more_offsets = closure(normals, offsets, np.deg2rad(5), 12)
    if len(more):
        more, more_offsets, _ = align(surface, more, more_offsets, queries[: settings.middle_points], settings.middle_scales)
        normals, offsets = torch.cat([normals, more]), torch.cat([offsets, more_offsets])
    scores = misfit(surface, normals, offsets, queries)
    kept = distinct(normals, -scores, 5.0)
    kept = kept[(scores[kept] < settings.good) | (torch.arange(len(kept)) < 1)]
    normals, offsets = normals[kept], offsets[kept]
    relations = find_relations(normals, offsets, np.deg2rad(tolerance), 0.04)
    normals, offsets, _ = align(surface, normals, offsets, queries, (scale,), 3, relations)
    return normals, offsets, scores[kept]


def detect(points: np.ndarray, settings=M4Settings(), clock=None, trace=None):
    import time
    marks = [time.perf_counter()]
    tick = lambda: marks.append(time.perf_counter())
    points = np.asarray(points, np.float64)
    centre = points.mean(0)
    scale = float(np.sqrt(12 * np.square(points - centre).sum(1).mean()))
    order = np.argsort(canonical_order(points), kind="stable")[: settings.points]
    cloud = torch.from_numpy(((points[order] - centre) / scale).astype(np.float32))
    half = float(cloud.abs().max().clamp_max(1.0)) * 1.1
    some = lambda count: torch.arange(min(len(cloud), count))
    tick()
    surface = local_surface(cloud, settings.neighbours, settings.surface_scales)
    tick()
    size = 48
    volume = density_volume(cloud, half, size, 0.03)
    queries = cloud[: settings.search_points]
    weights = 1 - look_up(volume, queries, half, size)
    directions, around = hemisphere(settings.directions)
    scores = direction_scores(volume, queries, weights, directions, torch.zeros(1), half, size)[:, 0]
    peaks = local_maxima(scores, around, settings.candidates)
    normals, offsets = directions[peaks], torch.zeros(len(peaks))
    tick()
    nearest = nearest_volume(cloud[:2048], half, 48, 2)
    tick()
    normals, offsets = coarse(surface, nearest, half, 48, normals, offsets, some(settings.coarse_points), settings.coarse_scales)
    scores = -misfit(surface, normals, offsets, some(settings.coarse_points))
    kept = distinct(normals, scores, 4.0)
    kept = kept[(-scores[kept] < settings.pruned) | (torch.arange(len(kept)) < 1)][:24]
    normals, offsets = normals[kept], offsets[kept]
    tick()
    normals, offsets, blind = align(surface, normals, offsets, some(settings.middle_points), settings.middle_scales)
    offsets = with_ends(surface, normals, offsets, blind)
    scores = misfit(surface, normals, offsets, some(settings.fine_points))
    tick()
    keep = distinct(normals, -scores, 4.0)
    normals, offsets, scores = normals[keep], offsets[keep], scores[keep]
    if trace is not None: trace.append((normals, offsets, scores))
    good = (scores < settings.good) | (torch.arange(len(scores)) < 1)
    normals, offsets = normals[good], offsets[good]
    tick()
    for stage_scale, tolerance in settings.group_stages:
        normals, offsets, scores = regrouped(surface, normals, offsets, some(settings.fine_points), stage_scale, tolerance, settings)
    tick()
    relations = find_relations(normals, offsets, np.deg2rad(1.5), 0.03)
    normals, offsets, blind = align(surface, normals, offsets, some(settings.final_points), settings.final_scales, 2, relations)
    offsets = with_ends(surface, normals, offsets, blind)
    tick()
    scores = misfit(surface, normals, offsets, some(settings.fine_points))
    tick()
    kept = distinct(normals, -scores, 5.0)
    normals, offsets, scores = normals[kept], offsets[kept], scores[kept]
    if clock is not None:
        clock.append(np.diff(marks))
    n, d = normals.double().numpy(), offsets.double().numpy()
    return Planes(n, n * d[:, None], 1 / (1 + np.exp(20 * (scores.double().numpy() - .25)))).transformed(scale=scale, translation=centre)
