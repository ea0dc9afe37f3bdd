"""M4's confidences: what a plane's features are worth on shapes of the training split, as logistic regressions."""

import json
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np
import torch
from scipy.spatial import cKDTree
from sklearn.linear_model import LogisticRegression
from tqdm import tqdm

from symshrec.benchmark.assemblies import draw_assembly
from symshrec.benchmark.cloud import FAMILIES, PLANELESS, LabelledCloud, Labels
from symshrec.benchmark.config import BenchmarkConfig
from symshrec.benchmark.generate import generate_cloud
from symshrec.benchmark.perturbations import PERTURBATIONS as PERTURB
from symshrec.benchmark.scene import Scene
from symshrec.benchmark.surfaces import Moved
from symshrec.geometry.rotations import uniform_rotation
from symshrec.methods.fit.frame import frame_of
from symshrec.methods.m4.confidence import SURFACE_NAMES, features
from symshrec.methods.m4.density_search import DensitySearch
from symshrec.methods.m4.pipeline import observed, surface_candidates
from symshrec.methods.m4.settings import M4Settings
from symshrec.planes import Planes, axis_angles
from symshrec.runs.provenance import code_version

Labelled = tuple[np.ndarray, np.ndarray]  # features (K, F) of planes, and which are true (K,)
# Degrees and percent of the diagonal: a plane is true below the first, and left out up to the second.
TRUE, NEITHER = 1.5, 3.0
SURFACE_TRUE, SURFACE_NEITHER = 1.2, 4.0
BENT = "P15"
ASSEMBLIES, ASSEMBLY_POINTS = 77, (300, 9000)  # the stream of random numbers that they are drawn from; least, most
# An object is nearly symmetric if fewer of its points than this share are mirrored further off it than so much of its
# diagonal.
NEARLY, OFF = 0.2, 0.012
MIRRORED, DENSE = 1500, 20_000  # points that are mirrored, and that stand for the object


def labelled_candidates(benchmark: BenchmarkConfig, clouds: int, perturbations: list[str]) -> Iterator[Labelled]:
    """Features (K, 3) of M4's candidate planes and which are true (K,), cloud by cloud of the training split.

    Args:
        clouds: in all, as many under each of the perturbations.
    """
    settings = M4Settings()
    for cloud in _clouds(benchmark, clouds, perturbations, 0.0):
        frame = frame_of(cloud.points, settings.points)
        assert frame is not None  # a surface of the benchmark spreads in three directions
        with torch.inference_mode():
            (normals, offsets, divergences), _ = DensitySearch(frame.points, settings).planes()
        errors = _errors(frame.planes(normals, offsets, divergences), cloud)
        clear = (errors < TRUE) | (errors > NEITHER)
        yield features(divergences, len(frame.points)).numpy()[clear], (errors < TRUE)[clear]


def labelled_surface_candidates(
    benchmark: BenchmarkConfig, clouds: int, assemblies: int, perturbations: list[str], planeless: float
) -> Iterator[Labelled]:
    """The same of the planes (K, 13) that surface judges, none of a cloud of which density settles all.

    Args:
        clouds: of the benchmark; assemblies: further ones of objects put together of parts.
        planeless: the share of the clouds of the benchmark that have no plane.
    """
    for cloud in _clouds(benchmark, clouds, perturbations, planeless):
        yield _surface_labelled(cloud, None)
    for index in range(assemblies):
        yield _surface_labelled(*_assembly(benchmark, index, perturbations[index % len(perturbations)]))


def _surface_labelled(cloud: LabelledCloud, clean: np.ndarray | None) -> Labelled:
    """Features (K, 13) of a cloud's planes and which are true (K,).

    Left out are planes near a true one, those about which the clean object, of which these are points (M, 3), is nearly
    symmetric, and all that are not true of a bent object, which was symmetric about some of them.
    """
    settings = M4Settings()
    with torch.inference_mode():
        seen = observed(cloud.points, settings)
        if seen is None or seen.settled:
            return np.zeros((0, len(SURFACE_NAMES))), np.zeros(0, dtype=bool)
        found = surface_candidates(seen, settings)
    planes = seen.frame.planes(found.normals, found.offsets, torch.ones(len(found.normals)))
    errors = _errors(planes, cloud)
    false = (errors > SURFACE_NEITHER) & (cloud.labels.perturbation != BENT)
    if clean is not None:
        false &= _mismatches(planes, clean) > NEARLY
    clear = (errors < SURFACE_TRUE) | false
    return found.features.numpy()[clear], (errors < SURFACE_TRUE)[clear]


def calibrate(labelled: Iterable[Labelled], clouds: int, names: Sequence[str], seed: int, path: Path) -> None:
    """Fit, and write the record to `path`: under its stem the numbers, and what they were fitted on.

    Args:
        labelled: planes of every one of the clouds. names: of the features.
    """
    tables, labels = zip(*tqdm(labelled, total=clouds, unit="cloud"), strict=True)
    truth = np.concatenate(labels)
    record = {
        path.stem: fitted(np.concatenate(tables), truth),
        "names": ["intercept", *names],
        "clouds": clouds,
        "clouds_that_count": sum(len(each) > 0 for each in labels),
        "true_planes": int(truth.sum()),
        "false_planes": int((~truth).sum()),
        "seed": seed,
        "code": code_version(),
    }
    path.write_text(json.dumps(record, indent=1) + "\n")
    print(f"{record[path.stem]} ({path})")


def fitted(table: np.ndarray, truth: np.ndarray) -> list[float]:
    """Intercept and weights of the features (n, F) by which they tell what is true (n,)."""
    scale = table.std(0)
    scale[scale == 0] = 1
    fit = LogisticRegression(C=1e3, max_iter=5000).fit(table / scale, truth)
    return [round(float(weight), 3) for weight in (fit.intercept_[0], *(fit.coef_[0] / scale))]


def _clouds(
    benchmark: BenchmarkConfig, clouds: int, perturbations: list[str], planeless: float
) -> Iterator[LabelledCloud]:
    split, without = benchmark.splits["train"], round(planeless * clouds)
    split.clouds = clouds
    split.perturbations = dict(zip(perturbations, _shares(clouds, len(perturbations)), strict=True))
    split.families = dict(zip(FAMILIES, _shares(clouds - without, len(FAMILIES)), strict=True))
    if without:
        split.families[PLANELESS] = without
    for index in range(clouds):
        yield generate_cloud(benchmark, "train", index)


def _assembly(benchmark: BenchmarkConfig, index: int, perturbation: str) -> tuple[LabelledCloud, np.ndarray]:
    """A perturbed cloud of an object put together of parts, in a random pose, and points (M, 3) of the clean object."""
    rng = np.random.default_rng([benchmark.seed, ASSEMBLIES, index])
    upright, planes = draw_assembly(rng)
    turn = uniform_rotation(rng)
    surface, planes = Moved(upright, turn, np.zeros(3)), planes.transformed(turn)
    few, many = ASSEMBLY_POINTS
    chart = surface.draw(round(few * (many / few) ** rng.random()), rng)
    clean = surface.points(surface.draw(DENSE, rng))
    scene = Scene(surface.points(chart), planes, surface, chart)
    points, drawn, planes = PERTURB[perturbation](scene, rng, benchmark.noise)
    labels = Labels(perturbation=perturbation, parameters=drawn)
    return LabelledCloud(points.astype(np.float32), planes, labels, index, f"assembly {index}"), clean


def _mismatches(planes: Planes, clean: np.ndarray) -> np.ndarray:
    """The share (K,) of an object's points (M, 3) that each plane mirrors off the object."""
    tree, some = cKDTree(clean), clean[:MIRRORED]
    far = OFF * np.linalg.norm(np.ptp(clean, axis=0))
    images = planes.mirror(some)
    return np.array([(tree.query(each)[0] > far).mean() for each in images])


def _shares(total: int, parts: int) -> list[int]:
    return [total // parts + (part < total % parts) for part in range(parts)]


def _errors(planes: Planes, cloud: LabelledCloud) -> np.ndarray:
    """How far each plane (K,) is from the nearest true one: the larger of degrees and percent of the diagonal."""
    true = cloud.truth
    if not len(true):
        return np.full(len(planes), np.inf)
    angles = np.rad2deg(axis_angles(planes.normals, true.normals))
    gaps = np.einsum("ktd,td->kt", planes.points[:, None] - true.points, true.normals)
    return np.maximum(angles, 100 * np.abs(gaps) / cloud.diagonal).min(1)
