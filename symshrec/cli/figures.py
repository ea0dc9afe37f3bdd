"""`symshrec figures`: Figure 2, and the perturbations of section 2.1, from our own clouds."""

from pathlib import Path

from omegaconf import DictConfig

from symshrec.runs.command import entry


@entry
def command(config: DictConfig) -> None:
    """Write results/figures/ and say what was written."""
    from symshrec.reporting.figures.figures import make_figures

    print("\n".join(f"written: {path}" for path in make_figures(Path(config.paths.results) / "figures")))
