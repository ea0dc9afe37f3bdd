"""M4's confidences, fitted on clouds of the training split: `python experiments/calibrate.py`, a few minutes.

Writes results/calibration.json; its numbers are the defaults of the code and of the configuration, which a test checks.
P6 is left out: a true plane of a cloud with a side cut away fits it as badly as a false one of a whole cloud.
"""

import json
from pathlib import Path

import numpy as np
from omegaconf import DictConfig

from symshrec.methods.m4.confidence import NAMES
from symshrec.runs.calibration import fitted, labelled_candidates
from symshrec.runs.command import entry
from symshrec.runs.config import benchmark_of, load
from symshrec.runs.provenance import code_version

CLOUDS = 2700
PERTURBATIONS = [f"P{number}" for number in range(10) if number != 6]


@entry
def calibrate(config: DictConfig) -> None:
    """Search planes on training shapes under every perturbation but P6, and regress what is true on the features."""
    benchmark = benchmark_of(load(["data=paper", f"seed={config.seed}"]))
    columns, labels = [], []
    for index, (found, true) in enumerate(labelled_candidates(benchmark, CLOUDS, PERTURBATIONS), 1):
        columns.append(found)
        labels.append(true)
        if index % 100 == 0:
            print(f"{index} of {CLOUDS} clouds", flush=True)
    truth = np.concatenate(labels)
    record = {
        "calibration": fitted(np.concatenate(columns), truth),
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


if __name__ == "__main__":
    calibrate()
