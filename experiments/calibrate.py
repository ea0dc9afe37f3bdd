"""M4's confidences, fitted on clouds of the training split: `python experiments/calibrate.py`, a few minutes.

Writes results/calibration.json; its numbers are the defaults of the code and of the configuration, which a test checks.
P6 is left out: a true plane of a cloud with a side cut away fits it as badly as a false one of a whole cloud.
"""

import json
from pathlib import Path

import numpy as np
import torch
from omegaconf import DictConfig
from sklearn.linear_model import LogisticRegression

from symshrec.benchmark.cloud import LabelledCloud
from symshrec.benchmark.generate import generate_cloud
from symshrec.configs import benchmark_of, entry, load
from symshrec.methods.m4.confidence import NAMES, features
from symshrec.methods.m4.detection import M4Settings, Search
from symshrec.methods.refine.frame import frame_of
from symshrec.planes import axis_angles
from symshrec.provenance import code_version

CLOUDS = 2700
PERTURBATIONS = [f"P{number}" for number in range(10) if number != 6]
TRUE, NEITHER = 1.5, 3.0  # degrees and percent of the diagonal: true below the first, left out up to the second


@entry
def calibrate(config: DictConfig) -> None:
    """Search planes on training shapes under every perturbation but P6, and regress what is true on the features."""
    share = {name: CLOUDS // len(PERTURBATIONS) for name in PERTURBATIONS}
    benchmark = benchmark_of(load(["data=paper", f"seed={config.seed}"]))
    benchmark.splits["train"].clouds, benchmark.splits["train"].perturbations = CLOUDS, share
    columns, labels = [], []
    for index in range(CLOUDS):
        found, true = candidates(generate_cloud(benchmark, "train", index))
        columns.append(found)
        labels.append(true)
        if index % 100 == 99:
            print(f"{index + 1} of {CLOUDS} clouds", flush=True)
    table, truth = np.concatenate(columns), np.concatenate(labels)
    scale = table.std(0)
    fit = LogisticRegression(C=1e3, max_iter=5000).fit(table / scale, truth)
    weights = [float(fit.intercept_[0]), *(fit.coef_[0] / scale).tolist()]
    record = {
        "calibration": [round(weight, 3) for weight in weights],
        "names": ["intercept", *NAMES],
        "clouds": CLOUDS,
        "true_planes": int(truth.sum()),
        "false_planes": int((~truth).sum()),
        "seed": config.seed,
        "code": code_version(),
    }
    path = Path(config.paths.results) / "calibration.json"
    path.write_text(json.dumps(record, indent=1) + "\n")
    print(f"{record['calibration']} ({path})")


def candidates(cloud: LabelledCloud) -> tuple[np.ndarray, np.ndarray]:
    """Features (K, 3) of M4's candidate planes of a cloud, and which of them are true (K,) bool."""
    frame = frame_of(cloud.points, M4Settings().points)
    with torch.inference_mode():
        normals, offsets, divergences = Search(frame.points, M4Settings()).planes()
    planes, true = frame.planes(normals, offsets, divergences), cloud.planes
    angles = np.rad2deg(axis_angles(planes.normals, true.normals))
    gaps = np.einsum("ktd,td->kt", planes.points[:, None] - true.points, true.normals)
    errors = np.maximum(angles, 100 * np.abs(gaps) / cloud.diagonal).min(1)
    clear = (errors < TRUE) | (errors > NEITHER)
    return features(divergences, len(frame.points)).numpy()[clear], (errors < TRUE)[clear]


if __name__ == "__main__":
    calibrate()
