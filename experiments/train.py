"""§3.1–3.2 Training, to be killed and resumed at will: `python experiments/train.py method=m1 run=r4 data=paper`."""

from pathlib import Path

from omegaconf import DictConfig

from symshrec.runs.config import entry
from symshrec.runs.cross_validation import fold_spread
from symshrec.runs.train import WEIGHTS, train


@entry
def main(config: DictConfig) -> None:
    """Train or go on; say what came of it and how to test it."""
    result = train(config)
    if result is None:
        return
    figures = ", ".join(f"{name.removeprefix('val/')} {value:.4f}" for name, value in result["validation"].items())
    print(f"{result['name']}, fold {result['fold']}: {result['epochs']:g} epochs in {result['seconds'] / 60:.1f} min")
    print(f"{result['validation_clouds']} validation clouds: {figures}")
    folds, spread = fold_spread(config)
    if folds:
        means = ", ".join(f"{name.removeprefix('val/')} {mean:.4f} ± {sd:.4f}" for name, (mean, sd) in spread.items())
        print(f"folds {', '.join(map(str, folds))}: {means}")
    print(
        f"weights: {Path(config.train.folder) / WEIGHTS}, for method.weights=[…] of evaluate.py "
        "or for train.init=… of a training that starts from them"
    )


if __name__ == "__main__":
    main()
