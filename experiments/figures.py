"""Figure 2, and the perturbations of section 2.1, from our own clouds: `python experiments/figures.py`."""

from pathlib import Path

from omegaconf import DictConfig

from symshrec.reporting.figures.figures import make_figures
from symshrec.runs.config import entry


@entry
def figures(config: DictConfig) -> None:
    """Write results/figures/ and say what was written."""
    print("\n".join(f"written: {path}" for path in make_figures(Path(config.paths.results) / "figures")))


if __name__ == "__main__":
    figures()
