"""§2.2 The perturbations P0–P5, and P6–P9 beyond the paper. A new one is one function and one name in PERTURBATIONS.

Each takes points (N, 3) float64 (its own to change), a generator and the config, and gives the perturbed points with
the parameters drawn. Lengths are in the units of the scaled shape. The true planes stay those of the unperturbed shape.
P10–P15, in `scan_perturbations`, need more of the clean cloud than its points: a Scene.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from symshrec.benchmark.config import DrawnPer, NoiseConfig, NoiseShift
from symshrec.benchmark.ranges import uniform_in, whole_in
from symshrec.benchmark.scan_perturbations import SCAN as SCAN_PERTURBATIONS
from symshrec.benchmark.scene import Perturbed, Scene

Made = tuple[np.ndarray, dict[str, float]]


def clean(points: np.ndarray, rng: np.random.Generator, config: NoiseConfig) -> Made:
    """P0: the points as they are."""
    return points, {}


def uniform_noise(points: np.ndarray, rng: np.random.Generator, config: NoiseConfig) -> Made:
    """P1: a random share of the points moves by U(−1/n, 1/n)³."""
    return _moved(points, rng, config, config.uniform_n, 1.0, lambda shape: rng.uniform(-1.0, 1.0, shape))


def gaussian_noise(points: np.ndarray, rng: np.random.Generator, config: NoiseConfig) -> Made:
    """P2: a random share of the points moves by N(0, σ²) per coordinate, σ = gaussian_scale · n^-gaussian_power."""
    scale, power = config.gaussian_scale, config.gaussian_power
    return _moved(points, rng, config, config.gaussian_n, power, lambda shape: scale * rng.standard_normal(shape))


def undersampling(points: np.ndarray, rng: np.random.Generator, config: NoiseConfig) -> Made:
    """P3: a random share of the points is removed; the rest keep their order, and at least one stays."""
    share = uniform_in(rng, config.removed_fraction)
    removed = min(round(share * len(points)), len(points) - 1)
    keep = np.ones(len(points), dtype=bool)
    keep[_rows(len(points), removed, rng)] = False
    return points.compress(keep, axis=0), {"removed_fraction": share}


def in_turn(*perturbations: Callable[..., Made]) -> Callable[..., Made]:
    """One perturbation after another, their parameters together."""

    def combined(points: np.ndarray, rng: np.random.Generator, config: NoiseConfig) -> Made:
        parameters = {}
        for perturbation in perturbations:
            points, drawn = perturbation(points, rng, config)
            parameters |= drawn
        return points, parameters

    return combined


def cut_away(points: np.ndarray, rng: np.random.Generator, config: NoiseConfig) -> Made:
    """P6: a share of the points is missing on one side, beyond a random plane or around a random point of the cloud.

    The plane's direction is uniform on the sphere, and it lies where it cuts off just that share; the hole is the ball
    about its point that holds just that share. The rest keep their order, and at least one stays.
    """
    share = uniform_in(rng, config.hard.cut_fraction)
    hole = rng.random() < config.hard.hole_probability
    if hole:
        depths = -np.linalg.norm(points - points[rng.integers(len(points))], axis=1)
    else:
        depths = points @ rng.standard_normal(3)
    removed = min(round(share * len(points)), len(points) - 1)
    keep = np.ones(len(points), dtype=bool)
    keep[np.argsort(-depths, kind="stable")[:removed]] = False
    return points[keep], {"removed_fraction": share, "hole": float(hole)}


def strong_noise(points: np.ndarray, rng: np.random.Generator, config: NoiseConfig) -> Made:
    """P7: P1 or P2, with equal chances, at a smaller n; the parameter gaussian is 1 for P2's noise and 0 for P1's."""
    gaussian = rng.random() < 0.5
    choices = config.hard.strong_n
    published = replace(config, uniform_n=choices, gaussian_n=choices)
    points, drawn = (gaussian_noise if gaussian else uniform_noise)(points, rng, published)
    return points, drawn | {"gaussian": float(gaussian)}


def outliers(points: np.ndarray, rng: np.random.Generator, config: NoiseConfig) -> Made:
    """P8: a share more points, uniform in the cloud's axis-aligned bounding box, at random places among the others.

    All true points stay, in their order, and so does the bounding box.
    """
    share = uniform_in(rng, config.hard.outlier_fraction)
    added = rng.uniform(points.min(axis=0), points.max(axis=0), (round(share * len(points)), 3))
    rows = rng.integers(len(points), size=len(added), endpoint=True)
    return np.insert(points, rows, added, axis=0), {"outlier_fraction": share}


def few_points(points: np.ndarray, rng: np.random.Generator, config: NoiseConfig) -> Made:
    """P9: a random few of the points are left, their number uniform between two ends; they keep their order."""
    left = min(whole_in(rng, config.hard.few_points), len(points))
    return points[np.sort(_rows(len(points), left, rng))], {"points_left": float(left)}


def of_points(perturbation: Callable[..., Made]) -> Callable[[Scene, np.random.Generator, NoiseConfig], Perturbed]:
    """A perturbation of points alone as one of a Scene, whose planes stay true."""

    def of_scene(scene: Scene, rng: np.random.Generator, config: NoiseConfig) -> Perturbed:
        return Perturbed(*perturbation(scene.points, rng, config), scene.planes)

    return of_scene


PUBLISHED_PERTURBATIONS: dict[str, Callable[..., Perturbed]] = {
    "P0": of_points(clean),
    "P1": of_points(uniform_noise),
    "P2": of_points(gaussian_noise),
    "P3": of_points(undersampling),
    "P4": of_points(in_turn(uniform_noise, undersampling)),
    "P5": of_points(in_turn(gaussian_noise, undersampling)),
}
HARD_PERTURBATIONS: dict[str, Callable[..., Perturbed]] = {
    "P6": of_points(cut_away),
    "P7": of_points(strong_noise),
    "P8": of_points(outliers),
    "P9": of_points(few_points),
}
PERTURBATIONS = PUBLISHED_PERTURBATIONS | HARD_PERTURBATIONS | SCAN_PERTURBATIONS


def _rows(total: int, count: int, rng: np.random.Generator) -> np.ndarray:
    """`count` of `total` rows, without replacement, in random order."""
    return rng.permutation(total)[:count]


def _moved(points, rng, config, choices, power, draw) -> Made:
    """Shift a random share of the points by draw((k, 3 or 1)) / n^power, n from `choices`."""
    share = uniform_in(rng, config.fraction)
    rows = _rows(len(points), round(share * len(points)), rng)
    per_point = config.n_per is DrawnPer.point
    n = rng.choice(choices, (len(rows), 1)) if per_point else rng.choice(choices)
    shifts = draw((len(rows), 1 if config.shift is NoiseShift.scalar else 3))
    shifts = np.broadcast_to(shifts * np.power(n, -float(power)), (len(rows), 3))
    # One coordinate after the other, here and elsewhere: NumPy is slow where the innermost loop is over three numbers.
    for coordinate, shift in zip(points.T, shifts.T, strict=True):
        coordinate[rows] += shift
    return points, {"noise_fraction": share} | ({} if per_point else {"noise_n": float(n)})
