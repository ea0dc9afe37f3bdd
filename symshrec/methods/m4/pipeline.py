"""M4, our training-free detector: one cloud in, its mirror planes out."""

from dataclasses import dataclass
from functools import cached_property
from math import cos, radians

import numpy as np
import torch
from torch import Tensor

from symshrec.methods.fit.alignment import AlignmentSettings, aligned
from symshrec.methods.fit.coupling import distinct
from symshrec.methods.fit.density import Density
from symshrec.methods.fit.evening import EVEN, evened, unevenness
from symshrec.methods.fit.floor import without_floor
from symshrec.methods.fit.frame import Frame, checked, frame_of
from symshrec.methods.fit.judgement import Judge
from symshrec.methods.fit.likelihood import ascended, divergence
from symshrec.methods.fit.polishing import polished, slid
from symshrec.methods.fit.surface import Neighbours
from symshrec.methods.m4.climb import FINE_POINTS, FINE_STEPS, LONGEST_STEP, Scored
from symshrec.methods.m4.confidence import confidences, features, logits, surface_features
from symshrec.methods.m4.density_search import DensitySearch
from symshrec.methods.m4.settings import M4Settings
from symshrec.methods.m4.surface_search import SurfaceSearch, repulsion
from symshrec.planes import Planes

GROUP = 0.015  # divergence above the best plane's up to which planes are aligned together
ALIGNED = 0.1  # least confidence of another plane that is aligned, on its own
SURE = 0.9  # confidence by density from which a plane is sure
ADDED, LIKELY, UNLIKELY = 0.89, 0.5, 0.3  # confidence of what surface adds to sure planes, at most; likely; unlikely
LESSER, BESIDE = 0.07, 15.0  # value below a sure plane's, and degrees from one, at which a further plane is unlikely
RIVAL = 0.1  # divergence above the best plane's up to which another plane of an even cloud may be a stressed symmetry
WHOLE, THINNED = 0.15, 0.16  # its divergences in the cloud and in the evened one from which it is unlikely all the same
FLAT, SHEET = 0.01, 0.3  # distance to a plane, and share of points no further from it: it is the cloud's own sheet
NOISY = 1.0  # count · spacing² of the evened cloud, beyond which its points fill a volume rather than a surface
WORTH = 0.5  # of the best plane's merit, of another that is aligned


@dataclass(frozen=True, eq=False)
class Found:
    """Planes of a cloud in its frame: normals (K, 3), offsets (K,), confidences (K,) float64."""

    normals: Tensor
    offsets: Tensor
    confidences: Tensor


@dataclass(frozen=True, eq=False)
class Observed:
    """A cloud in its frame, what density finds in it, and the `finest` density.

    rivalled: whether the search came across a further plane that fits nearly as well as the best one.
    """

    frame: Frame
    cloud: Neighbours
    found: Found
    finest: Density
    rivalled: bool

    @property
    def sure(self) -> bool:
        """Whether a plane is sure by density."""
        return bool((self.found.confidences >= SURE).any())

    @cached_property
    def uneven(self) -> float:
        """See `unevenness`."""
        return unevenness(self.cloud)

    @property
    def even(self) -> bool:
        """Whether the cloud is an even sample, as far as density tells."""
        return self.uneven <= EVEN

    @property
    def settled(self) -> bool:
        """Whether surface need not be asked: an even cloud with a sure plane and no rival of it has no others."""
        return self.sure and not self.rivalled and self.even

    @property
    def only_sheets(self) -> bool:
        """Whether all that is sure are planes in which a large part of the cloud lies, as a floor does."""
        sure = self.found.confidences >= SURE
        heights = self.found.normals[sure] @ self.frame.points.T - self.found.offsets[sure, None]
        return bool(((heights.abs() < FLAT).float().mean(1) > SHEET).all())


@dataclass(frozen=True, eq=False)
class Candidates:
    """Planes of a cloud in its frame that may be symmetries: normals (K, 3), offsets (K,); those density found last.

    features: (K, 13), see `surface_features`. value (K,): how much surface they mirror, see `Judgement`. whole, thinned
    (K,): divergences in the cloud and in the evened one.
    """

    normals: Tensor
    offsets: Tensor
    features: Tensor
    value: Tensor
    whole: Tensor
    thinned: Tensor


@torch.inference_mode()
def detect_planes(points, settings: M4Settings | None = None) -> Planes:
    """The mirror planes of one cloud, by descending confidence.

    Where the cloud is an even sample of a whole object, a plane is judged by how well the mirrored cloud fits the
    cloud's own density. Where no plane is sure by that, where another fits nearly as well as one that is, or where the
    sample is uneven, planes are sought and judged by surface, off the floor: how much of it has a mirror image,
    wherever one could have been observed (see `Judgement`).

    Confidence says how likely a plane is a symmetry. The order of the points and their position change nothing. Pose
    and scale change which points are used first and how the grid lies: on noisy clouds some hundredths of a degree, and
    up to half a percent of the diagonal where only the ends of the cloud tell an offset. A sphere or a surface of
    revolution, symmetric about infinitely many planes, gets some of them, at least `separation_deg` apart.

    Args:
        points: (N, 3) tensor (worked on where it lies) or array, any unit. Coincident points count once; fewer than
            four distinct points, or points on a straight line, have no planes.
        settings: the default ones where omitted.

    Returns:
        Planes in the coordinates of the points.

    Raises:
        ValueError: for a wrong shape or values that are not finite.
    """
    settings = settings or M4Settings()
    seen = observed(points, settings)
    if seen is None:
        return Planes.empty()
    found = seen.found if seen.settled else found_by_surface(seen, settings)
    kept = distinct(found.normals, -found.confidences, settings.separation_deg)[: settings.max_planes]
    return seen.frame.planes(found.normals[kept], found.offsets[kept], found.confidences[kept]).ranked()


def observed(points, settings: M4Settings) -> Observed | None:
    """What density finds in the points (N, 3); without the floor, where there is one and nothing else is sure with it.

    Returns:
        None for points that have no planes.
    """
    frame = frame_of(points, settings.points)
    if frame is None:
        return None
    seen = found_by_density(frame, settings)
    if not seen.only_sheets:
        return seen
    above = _off_the_floor(points, frame, settings)
    return seen if above is frame else found_by_density(above, settings)


def found_by_density(frame: Frame, settings: M4Settings) -> Observed:
    """What a cloud is symmetric about as an even sample of a whole object, the best first."""
    cloud, search = Neighbours(frame.points), DensitySearch(frame.points, settings)
    (normals, offsets, divergences), left = search.planes()
    sureness = confidences(divergences, len(frame.points), settings.calibration)
    alignment = AlignmentSettings(neighbours=settings.neighbours, rounds=settings.rounds)
    group = divergences < divergences.min() + GROUP
    rest = (sureness >= ALIGNED) & ~group
    for rows, together in ((group, settings.together), (rest, False)):
        if rows.any():
            tied = torch.full_like(offsets[rows], together, dtype=torch.bool)
            normals[rows], _, offsets[rows] = aligned(cloud, normals[rows], offsets[rows], tied, alignment)
    return Observed(
        frame, cloud, Found(normals, offsets, sureness), search.densities[-1], _rivalled(left, normals, sureness)
    )


def _rivalled(left: Scored, normals: Tensor, sureness: Tensor) -> bool:
    """Whether one of the planes left, away from the sure ones of normals (K, 3), fits nearly as well as the best."""
    others, _, divergences = left
    apart = _degrees_apart(others, normals[sureness >= SURE], BESIDE)
    return bool((apart & (divergences < divergences.min() + RIVAL)).any())


def _degrees_apart(normals: Tensor, others: Tensor, degrees: float) -> Tensor:
    """Which of normals (K, 3) are over so many degrees from all others (J, 3)."""
    return ((normals @ others.T).abs() <= cos(radians(degrees))).all(1)


def found_by_surface(seen: Observed, settings: M4Settings) -> Found:
    """What a cloud is symmetric about as far as its surface was observed, beside what density found."""
    candidates = surface_candidates(seen, settings)
    sureness = torch.sigmoid(logits(candidates.features, settings.surface_calibration))
    if seen.sure:
        sureness = _beside_sure(seen, candidates, sureness)
    return Found(candidates.normals, candidates.offsets, sureness)


def _beside_sure(seen: Observed, candidates: Candidates, by_surface: Tensor) -> Tensor:
    """Confidences (K,) where some planes are sure by density: these keep theirs, and come before what surface adds.

    What surface adds must mirror about as much surface as a sure plane does, and not be one of them again. In an even
    sample it must also be nearly likely: something is missing there, but not a large part.
    """
    by_density = torch.zeros_like(by_surface)
    by_density[-len(seen.found.confidences) :] = seen.found.confidences
    sure = by_density >= SURE
    doubtful = candidates.value < candidates.value[sure].max() - LESSER
    doubtful |= ~_degrees_apart(candidates.normals, candidates.normals[sure], BESIDE)
    if seen.even:
        doubtful |= (candidates.whole > WHOLE) | (candidates.thinned > THINNED)
    doubtful &= by_density < LIKELY
    confidences = by_surface.clamp_max(ADDED)
    confidences = torch.where(doubtful, confidences.clamp_max(UNLIKELY), confidences)
    confidences = torch.where(by_density >= LIKELY, torch.maximum(confidences, by_density), confidences)
    return torch.where(sure, by_density, confidences)


def surface_candidates(seen: Observed, settings: M4Settings) -> Candidates:
    """What may be symmetries of a cloud as far as its surface was observed, with what speaks for each."""
    cloud, first = seen.cloud, seen.found
    thin = evened(cloud)
    judge = Judge(cloud.points[thin.rows], thin.spacing)
    even = judge.even
    search = SurfaceSearch(judge, settings)
    normals, offsets, merit = search.planes(first.normals, first.offsets)
    fine = search.densities[-1]
    noisy = fine if len(even) * thin.spacing**2 > NOISY else None
    alignment = AlignmentSettings(neighbours=settings.neighbours, rounds=settings.rounds)
    rows = merit >= torch.minimum(merit.max(), WORTH * merit.max())  # merits may all be below 0
    new = _degrees_apart(normals, first.normals[first.confidences >= SURE], settings.separation_deg)
    if (rows & new).any():  # the others are the sure planes again
        best = normals[rows], offsets[rows], merit[rows]
        normals[rows], offsets[rows] = polished(cloud, judge, *best, search.tied(*best), alignment, noisy)
    others, places, value = slid(judge, judge(normals, offsets), normals, offsets, new)
    if len(others):
        others, places = ascended(fine, even, others, places, FINE_STEPS, LONGEST_STEP)
        alone = torch.zeros_like(value, dtype=torch.bool)
        others, places = polished(cloud, judge, others, places, value, alone, alignment)
    normals, offsets = torch.cat([normals, others, first.normals]), torch.cat([offsets, places, first.offsets])
    whole = divergence(seen.finest, cloud.points, normals, offsets)
    thinned = divergence(fine, even[:FINE_POINTS], normals, offsets) - repulsion(fine, cloud.points, thin.rows)
    by_density = logits(features(whole, len(cloud.points)), settings.calibration)
    judgement = judge(normals, offsets)
    cloud_is = len(even), thin.spacing, seen.uneven, seen.sure
    table = surface_features(by_density, thinned, judgement, *cloud_is)
    return Candidates(normals, offsets, table, judgement.strict, whole, thinned)


def _off_the_floor(points, frame: Frame, settings: M4Settings) -> Frame:
    """The frame of what stands on a floor; the given one where there is no floor, or nothing stands on it."""
    above = without_floor((checked(points) - frame.centre) / frame.scale, frame.points.double().cpu().numpy())
    if above.all():
        return frame
    if isinstance(points, Tensor):
        return frame_of(points[torch.from_numpy(above).to(points.device)], settings.points) or frame
    return frame_of(np.asarray(points)[above], settings.points) or frame
