"""§5 Tables, figures and metrics from runs/ into results/, which git keeps: `experiments/publish.py data=paper`."""

from omegaconf import DictConfig

from symshrec.runs.command import entry
from symshrec.runs.tabulate import publish


@entry
def main(config: DictConfig) -> None:
    """Copy, and say what was copied."""
    print("\n".join(f"written: {path}" for path in publish(config)))


if __name__ == "__main__":
    main()
