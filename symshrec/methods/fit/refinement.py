"""M4 steps 3 and 4 for any method: planes refined by maximum likelihood and point to plane, if they then fit better.

In an even sample of a whole object the cloud's density says which of two planes fits better; in any other, as in M4,
how much of the surface has a mirror image.
"""

from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from symshrec.methods.fit.alignment import AlignmentSettings, aligned
from symshrec.methods.fit.coupling import images_of_planes
from symshrec.methods.fit.density import densities
from symshrec.methods.fit.evening import EVEN, evened, unevenness
from symshrec.methods.fit.frame import frame_of
from symshrec.methods.fit.judgement import Judge
from symshrec.methods.fit.likelihood import ascended, divergence
from symshrec.methods.fit.surface import Neighbours
from symshrec.methods.settings import check_ranges
from symshrec.planes import Planes

COARSE_POINTS, COARSE_STEPS = 800, 4
FINE_POINTS, FINE_STEPS = 1500, 3
LONGEST_STEP = 0.06
STARTS = (0, 2)  # the coarsest density from which planes ascend, tried one after the other
# Divergences above the best plane's: of planes tied together, of planes that fit, and of planes that keep 1/e of their
# confidence. Of M1's refined planes for validation clouds 99 % of the true ones have less than .05, 90 % of the others
# more than .2. Of an uneven cloud, DOUBTFUL is of `value` below the best plane's.
TIED, LIKELY, DOUBTFUL = 0.025, 0.1, 0.15
PREFERRED = 1.02  # times its value an aligned plane counts, since it is the more exact
MOST_TIED = 60  # planes; the relations of more would take too long
FARTHEST_DEG, FARTHEST = 12.0, 0.12  # from the given plane, the second as a share of the cloud's size


@dataclass(frozen=True)
class RefineSettings:
    """points: most used of a cloud. neighbours, together, rounds: as in `M4Settings`.

    Raises:
        ValueError: naming the setting that is out of its range.
    """

    points: int = 8192
    neighbours: int = 12
    together: bool = True
    rounds: int = 10

    def __post_init__(self):
        check_ranges(self, {"points": (64, np.inf), "neighbours": (4, np.inf), "rounds": (0, np.inf)})


@dataclass(frozen=True, eq=False)
class Refined:
    """planes: K refined planes, in the order given, with the confidences given times `fit`.

    kept (K,) bool: where no plane was found within reach that fits better, so that the given one stayed.
    fit (K,): how well each fits beside the best of them, from 0 to 1, which that one has.
    """

    planes: Planes
    kept: np.ndarray
    fit: np.ndarray


@torch.inference_mode()
def refine_planes(points, planes: Planes, settings: RefineSettings | None = None) -> Refined:
    """Refine the planes that some method found, from errors of up to about 5° and 5 % of the cloud's diagonal.

    A plane moves only where its mirror image then fits the cloud better, and no further than 12° and 12 % of the
    cloud's size (see `frame_of`). What still fits much worse than the cloud's best plane loses confidence: with an
    unlikeness e above that one's, exp(−(e/0.15)²) of it is left. Unlikeness is the divergence of the mirrored cloud's
    density from the cloud's; of an uneven cloud, the surface that has no mirror image, what contradicts the symmetry
    weighing far more than what was not observed (see `Judgement.strict`).

    Args:
        points: (N, 3) tensor or array; as `symshrec.methods.m4.pipeline.detect_planes` takes them.
        planes: in the coordinates of the points.
        settings: the default ones where omitted.

    Raises:
        ValueError: for a wrong shape or values that are not finite.
    """
    settings = settings or RefineSettings()
    frame = frame_of(points, settings.points)
    if frame is None or not len(planes):
        return Refined(planes, np.ones(len(planes), dtype=bool), np.ones(len(planes)))
    given = frame.of(planes)
    settings = replace(settings, together=settings.together and len(planes) <= MOST_TIED)
    cloud = Neighbours(frame.points)
    by = _by_density if unevenness(cloud) <= EVEN else _by_surface
    normals, offsets, left, worse = by(cloud, given, settings)
    fit = (-((left - left.min()) / DOUBTFUL).square()).exp().double().cpu().numpy()
    kept = worse.cpu().numpy()
    sure = planes.confidences * fit
    found = frame.planes(normals, offsets, sure)
    where = kept[:, None]
    exact = Planes(np.where(where, planes.normals, found.normals), np.where(where, planes.points, found.points), sure)
    return Refined(exact, kept, fit)


def refined(points, planes: Planes) -> Planes:
    """The planes of `refine_planes` alone."""
    return refine_planes(points, planes).planes


def _by_density(cloud: Neighbours, given: tuple[Tensor, Tensor], settings: RefineSettings):
    """Refine planes (K, 3), (K,) of an even cloud.

    Returns:
        Normals, offsets, unlikenesses (K,), and which stayed as they were given (K,).
    """
    points, ladder = cloud.points, densities(cloud.points)
    climbed = _ascended(points, ladder, *given, settings.together)
    found = _aligned(cloud, *climbed, settings)

    def unlikeness(planes: tuple[Tensor, Tensor]) -> Tensor:
        return divergence(ladder[-1], points, *planes)

    found = _where(unlikeness(found) > climbed[2] + TIED, climbed, found)
    before, after = unlikeness(given), unlikeness(found)
    worse = (after >= before) | _far(found, given)
    return *_where(worse, (*given, before), (*found, after)), worse


def _by_surface(cloud: Neighbours, given: tuple[Tensor, Tensor], settings: RefineSettings):
    """The same of an uneven cloud, which is evened for all but the alignment."""
    thin = evened(cloud)
    judge = Judge(cloud.points[thin.rows], thin.spacing)
    climbed = _ascended(judge.even, densities(judge.even), *given, settings.together)
    found = _aligned(cloud, *climbed, settings)
    before, between, after = (judge(*planes[:2]).value for planes in (given, climbed, found))
    after = PREFERRED * after
    found = _where(between > after, climbed[:2], found)
    worse = (torch.maximum(between, after) <= before) | _far(found, given)
    normals, offsets = _where(worse, given, found)
    return normals, offsets, -judge(normals, offsets).strict, worse


def _ascended(
    points: Tensor, ladder, normals: Tensor, offsets: Tensor, together: bool
) -> tuple[Tensor, Tensor, Tensor]:
    """The best of several ascents and of the start: normals, offsets and divergences at the finest bandwidth."""
    some, more = points[:COARSE_POINTS], points[:FINE_POINTS]
    *_, middle, fine = ladder
    best = normals, offsets, divergence(middle, more, normals, offsets)
    for start in STARTS:
        there, places = normals, offsets
        for density in ladder[start:-1]:
            there, places = ascended(density, some, there, places, COARSE_STEPS, LONGEST_STEP)
        best = _better(best, (there, places, divergence(middle, more, there, places)))
    if together:
        for _ in range(2):
            best = _better(best, _images(ladder, some, more, *best))
    tied = (best[2] < best[2].min() + TIED) & together
    normals, offsets = ascended(fine, more, best[0], best[1], FINE_STEPS, LONGEST_STEP, tied)
    return normals, offsets, divergence(fine, points, normals, offsets)


def _aligned(cloud: Neighbours, normals: Tensor, offsets: Tensor, divergences: Tensor, settings: RefineSettings):
    """The planes that fit best aligned point to plane, the others as they are."""
    normals, offsets = normals.clone(), offsets.clone()
    order = torch.argsort(divergences, stable=True)
    sure = order[divergences[order] < divergences.min() + TIED]
    alignment = AlignmentSettings(neighbours=settings.neighbours, rounds=settings.rounds)
    tied = torch.full_like(sure, settings.together, dtype=torch.bool)
    normals[sure], _, offsets[sure] = aligned(cloud, normals[sure], offsets[sure], tied, alignment)
    return normals, offsets


def _far(planes: tuple[Tensor, Tensor], given: tuple[Tensor, Tensor]) -> Tensor:
    """Which planes (K,) are further from the given ones than refinement reaches."""
    cosines = (planes[0] * given[0]).sum(1)
    gaps = (planes[1] * cosines.sign() - given[1]).abs()
    return (cosines.abs() < np.cos(np.deg2rad(FARTHEST_DEG))) | (gaps > FARTHEST)


def _where(first: Tensor, these, those):
    """Normals, offsets and whatever else: of `these` where `first` (K,), else of `those`."""
    return tuple(
        torch.where(first.reshape(-1, *[1] * (one.dim() - 1)), one, other)
        for one, other in zip(these, those, strict=False)
    )


def _better(best, other):
    """Per plane the one of less divergence."""
    return _where(other[2] < best[2], other, best)


def _images(ladder, some: Tensor, more: Tensor, normals: Tensor, offsets: Tensor, divergences: Tensor):
    """For planes that do not fit yet, images of those that do in each other, where near; with their divergences."""
    good = divergences < divergences.min() + LIKELY
    if good.all() or good.sum() < 2:
        return normals, offsets, divergences
    images, places = (each.flatten(0, 1) for each in images_of_planes(normals[good], offsets[good]))
    cosines = normals @ images.T
    nearest = cosines.abs().argmax(1)
    near = (cosines.abs().amax(1) > np.cos(np.deg2rad(FARTHEST_DEG))) & ~good
    there, distances = ascended(ladder[-2], some, images[nearest], places[nearest], COARSE_STEPS, LONGEST_STEP)
    fit = divergence(ladder[-2], more, there, distances)
    return _where(near, (there, distances, fit), (normals, offsets, divergences))
