"""M4's confidences by surface, fitted on clouds of the training split: `python experiments/calibrate_surface.py`.

Writes results/surface_calibration.json; its numbers are the defaults of the code, which a test checks. Every
perturbation counts alike, a quarter of the shapes has no plane, and clouds with a plane that is sure by density are
left out, since surface is not asked there. About ten minutes of a core.
"""

import json
from pathlib import Path

import numpy as np
from omegaconf import DictConfig

from symshrec.benchmark.cloud import PERTURBATIONS
from symshrec.methods.m4.confidence import SURFACE_NAMES
from symshrec.runs.calibration import fitted, labelled_surface_candidates
from symshrec.runs.command import entry
from symshrec.runs.config import benchmark_of, load
from symshrec.runs.provenance import code_version

CLOUDS, PLANELESS_SHARE = 960, 0.25


@entry
def calibrate(config: DictConfig) -> None:
    """Search planes on training shapes under every perturbation, and regress what is true on the features."""
    benchmark = benchmark_of(load(["data=paper", f"seed={config.seed}"]))
    columns, labels = [], []
    clouds = labelled_surface_candidates(benchmark, CLOUDS, list(PERTURBATIONS), PLANELESS_SHARE)
    for index, (found, true) in enumerate(clouds, 1):
        columns.append(found)
        labels.append(true)
        if index % 100 == 0:
            print(f"{index} of {CLOUDS} clouds", flush=True)
    truth = np.concatenate(labels)
    record = {
        "surface_calibration": fitted(np.concatenate(columns), truth),
        "names": ["intercept", *SURFACE_NAMES],
        "clouds": CLOUDS,
        "of them judged by surface": sum(len(each) > 0 for each in labels),
        "true_planes": int(truth.sum()),
        "false_planes": int((~truth).sum()),
        "seed": config.seed,
        "code": code_version(),
    }
    path = Path(config.paths.results) / "surface_calibration.json"
    path.write_text(json.dumps(record, indent=1) + "\n")
    print(f"{record['surface_calibration']} ({path})")


if __name__ == "__main__":
    calibrate()
