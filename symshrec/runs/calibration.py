"""M4's confidences: what training shapes say a plane's divergence is worth, as a logistic regression."""

from collections.abc import Iterator

import numpy as np
import torch
from sklearn.linear_model import LogisticRegression

from symshrec.benchmark.cloud import LabelledCloud
from symshrec.benchmark.config import BenchmarkConfig
from symshrec.benchmark.generate import generate_cloud
from symshrec.methods.fit.frame import frame_of
from symshrec.methods.m4.confidence import features
from symshrec.methods.m4.pipeline import Search
from symshrec.methods.m4.settings import M4Settings
from symshrec.planes import axis_angles

TRUE, NEITHER = 1.5, 3.0  # degrees and percent of the diagonal: true below the first, left out up to the second


def labelled_candidates(
    benchmark: BenchmarkConfig, clouds: int, perturbations: list[str]
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Features (K, 3) of M4's candidate planes and which are true (K,), cloud by cloud of the training split.

    Args:
        clouds: in all, as many under each of the perturbations.
    """
    benchmark.splits["train"].clouds = clouds
    benchmark.splits["train"].perturbations = {name: clouds // len(perturbations) for name in perturbations}
    for index in range(clouds):
        yield _candidates(generate_cloud(benchmark, "train", index))


def fitted(table: np.ndarray, truth: np.ndarray) -> list[float]:
    """Intercept and weights of the features (n, 3) by which they tell what is true (n,)."""
    scale = table.std(0)
    fit = LogisticRegression(C=1e3, max_iter=5000).fit(table / scale, truth)
    return [round(float(weight), 3) for weight in (fit.intercept_[0], *(fit.coef_[0] / scale))]


def _candidates(cloud: LabelledCloud) -> tuple[np.ndarray, np.ndarray]:
    frame = frame_of(cloud.points, M4Settings().points)
    assert frame is not None  # a surface of the benchmark spreads in three directions
    with torch.inference_mode():
        normals, offsets, divergences = Search(frame.points, M4Settings()).planes()
    planes, true = frame.planes(normals, offsets, divergences), cloud.truth
    angles = np.rad2deg(axis_angles(planes.normals, true.normals))
    gaps = np.einsum("ktd,td->kt", planes.points[:, None] - true.points, true.normals)
    errors = np.maximum(angles, 100 * np.abs(gaps) / cloud.diagonal).min(1)
    clear = (errors < TRUE) | (errors > NEITHER)
    return features(divergences, len(frame.points)).numpy()[clear], (errors < TRUE)[clear]
