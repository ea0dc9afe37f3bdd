"""§3.1.1 Validation mAP over the epochs of all trainings on some data: `experiments/training_curves.py data=paper`."""

from pathlib import Path

from omegaconf import DictConfig

from symshrec.runs.command import entry


@entry
def main(config: DictConfig) -> None:
    """Read runs/<data>/training/, write training.png and .csv into results/<data>/, and say so."""
    from symshrec.reporting.figures.trainings import training_curves, write_training_curves

    name = f"{config.data.name}{config.data.variant}"
    curves = training_curves(Path(config.paths.runs) / name / "training")
    written = write_training_curves(curves, Path(config.paths.results) / name)
    print("\n".join(f"written: {path}" for path in written))


if __name__ == "__main__":
    main()
