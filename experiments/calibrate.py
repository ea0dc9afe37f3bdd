"""M4's confidences, fitted on clouds of the training split: `python experiments/calibrate.py`, a few minutes.

Writes results/calibration.json; its numbers are the defaults of the code and of the configuration, which a test checks.
P6 is left out: a true plane of a cloud with a side cut away fits it as badly as a false one of a whole cloud.
"""

from pathlib import Path

from omegaconf import DictConfig

from symshrec.methods.m4.confidence import NAMES
from symshrec.runs.calibration import calibrate, labelled_candidates
from symshrec.runs.command import entry
from symshrec.runs.config import benchmark_of, load

CLOUDS = 2700
PERTURBATIONS = [f"P{number}" for number in range(10) if number != 6]


@entry
def by_density(config: DictConfig) -> None:
    """Search planes on training shapes under every perturbation but P6, and regress what is true on the features."""
    benchmark = benchmark_of(load(["data=paper", f"seed={config.seed}"]))
    planes = labelled_candidates(benchmark, CLOUDS, PERTURBATIONS)
    calibrate(planes, CLOUDS, NAMES, config.seed, Path(config.paths.results) / "calibration.json")


if __name__ == "__main__":
    by_density()
