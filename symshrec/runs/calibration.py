"""M4's confidences: what a plane's features are worth on shapes of the training split, as logistic regressions."""

import json
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np
import torch
from sklearn.linear_model import LogisticRegression
from tqdm import tqdm

from symshrec.benchmark.cloud import FAMILIES, PLANELESS, LabelledCloud
from symshrec.benchmark.config import BenchmarkConfig
from symshrec.benchmark.generate import generate_cloud
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
            normals, offsets, divergences = DensitySearch(frame.points, settings).planes()
        errors = _errors(frame.planes(normals, offsets, divergences), cloud)
        clear = (errors < TRUE) | (errors > NEITHER)
        yield features(divergences, len(frame.points)).numpy()[clear], (errors < TRUE)[clear]


def labelled_surface_candidates(
    benchmark: BenchmarkConfig, clouds: int, perturbations: list[str], planeless: float
) -> Iterator[Labelled]:
    """The same of the planes (K, 8) that surface judges, none of a cloud with a plane that is sure by density.

    Args:
        planeless: the share of shapes without a plane.
    """
    settings = M4Settings()
    for cloud in _clouds(benchmark, clouds, perturbations, planeless):
        with torch.inference_mode():
            seen = observed(cloud.points, settings)
            assert seen is not None  # a surface of the benchmark spreads in three directions
            if seen.sure:
                yield np.zeros((0, len(SURFACE_NAMES))), np.zeros(0, dtype=bool)
                continue
            normals, offsets, table = surface_candidates(seen, settings)
        errors = _errors(seen.frame.planes(normals, offsets, torch.ones(len(normals))), cloud)
        clear = (errors < SURFACE_TRUE) | (errors > SURFACE_NEITHER)
        yield table.numpy()[clear], (errors < SURFACE_TRUE)[clear]


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
