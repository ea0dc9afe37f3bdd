"""§2.2 The perturbations P0–P5. A new one is one function and one name in PERTURBATIONS.

Each takes points (N, 3) float64 (its own to change), a generator and the config, and gives the perturbed points with
the parameters drawn. Lengths are in the units of the scaled shape.
"""

from collections.abc import Callable

import numpy as np

from symshrec.benchmark.config import DrawnPer, NoiseConfig, NoiseShift

Perturbed = tuple[np.ndarray, dict[str, float]]


def clean(points: np.ndarray, rng: np.random.Generator, config: NoiseConfig) -> Perturbed:
    """P0: the points as they are."""
    return points, {}


def uniform_noise(points: np.ndarray, rng: np.random.Generator, config: NoiseConfig) -> Perturbed:
    """P1: a random share of the points moves by U(−1/n, 1/n)³."""
    return _moved(points, rng, config, config.uniform_n, 1.0, lambda shape: rng.uniform(-1.0, 1.0, shape))


def gaussian_noise(points: np.ndarray, rng: np.random.Generator, config: NoiseConfig) -> Perturbed:
    """P2: a random share of the points moves by N(0, n^-2p) per coordinate, p = config.gaussian_power."""
    return _moved(points, rng, config, config.gaussian_n, config.gaussian_power, rng.standard_normal)


def undersampling(points: np.ndarray, rng: np.random.Generator, config: NoiseConfig) -> Perturbed:
    """P3: a random share of the points is removed; the rest keep their order, and at least one stays."""
    share = rng.uniform(*config.removed_fraction)
    removed = min(round(share * len(points)), len(points) - 1)
    keep = np.ones(len(points), dtype=bool)
    keep[_rows(len(points), removed, rng)] = False
    return points[keep], {"removed_fraction": share}


def in_turn(*perturbations: Callable[..., Perturbed]) -> Callable[..., Perturbed]:
    """One perturbation after another, their parameters together."""

    def combined(points: np.ndarray, rng: np.random.Generator, config: NoiseConfig) -> Perturbed:
        parameters = {}
        for perturbation in perturbations:
            points, drawn = perturbation(points, rng, config)
            parameters |= drawn
        return points, parameters

    return combined


PERTURBATIONS: dict[str, Callable[..., Perturbed]] = {
    "P0": clean,
    "P1": uniform_noise,
    "P2": gaussian_noise,
    "P3": undersampling,
    "P4": in_turn(uniform_noise, undersampling),
    "P5": in_turn(gaussian_noise, undersampling),
}


def _rows(total: int, count: int, rng: np.random.Generator) -> np.ndarray:
    """`count` of `total` rows, without replacement, in random order."""
    return rng.permutation(total)[:count]


def _moved(points, rng, config, choices, power, draw) -> Perturbed:
    """Shift a random share of the points by draw((k, 3 or 1)) / n^power, n from `choices`."""
    share = rng.uniform(*config.fraction)
    rows = _rows(len(points), round(share * len(points)), rng)
    per_point = config.n_per is DrawnPer.point
    n = rng.choice(choices, (len(rows), 1)) if per_point else rng.choice(choices)
    shifts = draw((len(rows), 1 if config.shift is NoiseShift.scalar else 3))
    points[rows] += shifts * np.power(n, -float(power))
    return points, {"noise_fraction": share} | ({} if per_point else {"noise_n": float(n)})
