"""§2.1, Table 1: the seven closed plane curves and their in-plane mirror lines."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from symshrec.benchmark.config import CitrusForm, CurveSampling, CurvesConfig, PetalFrequency
from symshrec.benchmark.ranges import uniform_in, whole_in

ARC_LENGTH_CHORDS = 8192
TURN = (-np.pi, np.pi)


@dataclass(frozen=True)
class Curve:
    """One curve of Table 1 with its parameters drawn.

    trace: u (U,) to x and y, (U,) each; with `two_branches` every u also gives the point (x, −y).
    domain: the half-open range of u. mirror_angles (L,): directions of the mirror lines through the origin, radians.
    """

    parameters: dict[str, float]
    trace: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
    mirror_angles: np.ndarray
    domain: tuple[float, float] = TURN
    two_branches: bool = False

    def points(self, u: np.ndarray) -> np.ndarray:
        """The curve at u (U,): (U, 2), or (2U, 2) with the upper branch first where there are two."""
        if not self.two_branches:
            return self.at(u, np.ones(len(u)))
        return self.at(np.concatenate([u, u]), np.repeat([1.0, -1.0], len(u)))

    def at(self, u: np.ndarray, branch: np.ndarray) -> np.ndarray:
        """The curve at u (U,) on the branch (U,), 1 for the upper or only one and −1 for the lower: (U, 2)."""
        x, y = self.trace(u)
        return np.stack([x, branch * y], axis=1)

    def draw(self, count: int, rng: np.random.Generator, sampling: CurveSampling) -> tuple[np.ndarray, np.ndarray]:
        """u and branch, (count,) each, of random points; where there are two, the upper's points come first."""
        draws = (count + 1) // 2 if self.two_branches else count
        low, high = self.domain
        if sampling is CurveSampling.grid:
            u = low + (high - low) * np.arange(draws) / draws
        elif sampling is CurveSampling.arc_length:
            u = self._at_arc_length(rng.random(draws))
        else:
            u = rng.uniform(low, high, draws)
        if not self.two_branches:
            return u, np.ones(count)
        return np.concatenate([u, u])[:count], np.repeat([1.0, -1.0], draws)[:count]

    def sample(self, count: int, rng: np.random.Generator, sampling: CurveSampling) -> np.ndarray:
        """`count` points of the curve, (count, 2); an odd count with two branches drops the last point."""
        return self.at(*self.draw(count, rng, sampling))

    def _at_arc_length(self, shares: np.ndarray) -> np.ndarray:
        """u at the given shares of the curve's length, by linear interpolation between dense chords."""
        u = np.linspace(*self.domain, ARC_LENGTH_CHORDS + 1)
        chords = np.hypot(*np.diff(self.trace(u), axis=1))
        lengths = np.concatenate([[0.0], np.cumsum(chords)])
        return np.interp(shares * lengths[-1], lengths, u)


def draw_curve(family: str, rng: np.random.Generator, config: CurvesConfig) -> Curve:
    """A curve of the family with parameters drawn from the ranges of Table 1.

    Raises:
        ValueError: for a family that Table 1 does not have, naming those it has.
    """
    if family not in CURVES:
        raise ValueError(f"unknown family {family!r}; Table 1 has {', '.join(CURVES)}")
    return CURVES[family](rng, config)


def _lines(count: int) -> np.ndarray:
    """Directions of `count` mirror lines, evenly spread from the x axis on."""
    return np.arange(count) * np.pi / count


def _polar(radius: Callable[[np.ndarray], np.ndarray]):
    def trace(u):
        rho = radius(u)
        return rho * np.cos(u), rho * np.sin(u)

    return trace


def astroid(rng: np.random.Generator, config: CurvesConfig) -> Curve:
    """x = a cos³u, y = a sin³u: four mirror lines."""
    a = config.astroid_a

    def trace(u):
        cosine, sine = np.cos(u), np.sin(u)
        return a * cosine * cosine * cosine, a * sine * sine * sine

    return Curve({"a": a}, trace, _lines(4))


def citrus(rng: np.random.Generator, config: CurvesConfig) -> Curve:
    """x = u − a/2, y = ± b √((a − u)³u³) / a² (or / (a² b)), u in [0, a): two mirror lines."""
    a, b = config.citrus_a, whole_in(rng, config.citrus_b)
    factor = (b if config.citrus_form is CitrusForm.multiply else 1 / b) / a**2

    def trace(u):
        product = (a - u) * u
        return u - a / 2, factor * product * np.sqrt(product)

    return Curve({"a": a, "b": b}, trace, _lines(2), (0.0, a), two_branches=True)


def m_convexities(rng: np.random.Generator, config: CurvesConfig) -> Curve:
    """ρ = a / (1 + b cos(m u)): m mirror lines."""
    a, b = uniform_in(rng, config.convexities_a), uniform_in(rng, config.convexities_b)
    m = whole_in(rng, config.convexities_m)
    return Curve({"a": a, "b": b, "m": m}, _polar(lambda u: a / (1 + b * np.cos(m * u))), _lines(m))


def geometric_petal(rng: np.random.Generator, config: CurvesConfig) -> Curve:
    """ρ = a + b cos(n u), n = 2m or m: n mirror lines."""
    a, b, m = uniform_in(rng, config.petal_a), whole_in(rng, config.petal_b), whole_in(rng, config.petal_m)
    n = 2 * m if config.petal_frequency is PetalFrequency.two_m else m
    return Curve({"a": a, "b": b, "m": m}, _polar(lambda u: a + b * np.cos(n * u)), _lines(n))


def lemniscate_bernoulli(rng: np.random.Generator, config: CurvesConfig) -> Curve:
    """x = a sin u / (1 + cos²u), y = a sin u cos u / (1 + cos²u): two mirror lines."""
    a = config.lemniscate_a

    def trace(u):
        cosine = np.cos(u)
        x = a * np.sin(u) / (1 + cosine * cosine)
        return x, x * cosine

    return Curve({"a": a}, trace, _lines(2))


def egg_keplero(rng: np.random.Generator, config: CurvesConfig) -> Curve:
    """x = a / (1 + u²)² − a/2, y = a u / (1 + u²)², u in [−4, 4): one mirror line."""
    a = config.egg_a

    def trace(u):
        x = a / np.square(1 + u * u)
        return x - a / 2, x * u

    return Curve({"a": a}, trace, _lines(1), (-4.0, 4.0))


def mouth_curve(rng: np.random.Generator, config: CurvesConfig) -> Curve:
    """x = a cos u, y = a sin³u: two mirror lines."""
    a = config.mouth_a

    def trace(u):
        sine = np.sin(u)
        return a * np.cos(u), a * sine * sine * sine

    return Curve({"a": a}, trace, _lines(2))


CURVES = {
    curve.__name__: curve
    for curve in (astroid, citrus, m_convexities, geometric_petal, lemniscate_bernoulli, egg_keplero, mouth_curve)
}
