"""M4's confidences by surface, fitted on clouds of the training split: `python experiments/calibrate_surface.py`.

Writes results/surface_calibration.json; its numbers are the defaults of the code, which a test checks. Every
perturbation counts alike, a quarter of the benchmark's shapes has no plane, about as many clouds again are of objects
put together of boxes, ellipsoids, cylinders and rings, and clouds that density settles do not count, since surface is
not asked there.
"""

from pathlib import Path

from omegaconf import DictConfig

from symshrec.benchmark.cloud import PERTURBATIONS
from symshrec.methods.m4.confidence import SURFACE_NAMES
from symshrec.runs.calibration import calibrate, labelled_surface_candidates
from symshrec.runs.command import entry
from symshrec.runs.config import benchmark_of, load

CLOUDS, ASSEMBLIES, PLANELESS_SHARE = 640, 704, 0.25


@entry
def by_surface(config: DictConfig) -> None:
    """Search planes on training shapes under every perturbation, and regress what is true on the features."""
    benchmark = benchmark_of(load(["data=paper", f"seed={config.seed}"]))
    planes = labelled_surface_candidates(benchmark, CLOUDS, ASSEMBLIES, list(PERTURBATIONS), PLANELESS_SHARE)
    calibrate(
        planes, CLOUDS + ASSEMBLIES, SURFACE_NAMES, config.seed, Path(config.paths.results) / "surface_calibration.json"
    )


if __name__ == "__main__":
    by_surface()
