"""§3.1–3.2 `symshrec train method=m1 run=r4 data=paper`: a training, to be killed and resumed at will."""

from pathlib import Path

from omegaconf import DictConfig

from symshrec.runs.command import entry


@entry
def command(config: DictConfig) -> float | None:
    """Train or go on; say what came of it and how to test it.

    The objective of a sweep is the validation's mAP, where there is no truth its loss with a minus.
    """
    from symshrec.runs.train import train

    result = train(config)
    if result is None:
        return None
    figures = result["validation"]
    told = _listed({name: f"{value:.4f}" for name, value in figures.items()}) or "none"
    if partial := result.get("partial"):
        print(f"{result['name']}: {result['steps']} steps (partial run, nothing stored: {', '.join(partial)})")
        print(f"validation: {told}")
    else:
        print(
            f"{result['name']}, fold {result['fold']}: {result['epochs']:g} epochs in {result['seconds'] / 60:.1f} min"
        )
        print(f"{result['validation_clouds']} validation clouds: {told}")
        _say_what_follows(config)
    loss = figures.get("val/loss")
    return figures.get("val/mAP", None if loss is None else -loss)


def _say_what_follows(config: DictConfig) -> None:
    from symshrec.runs.cross_validation import fold_spread
    from symshrec.runs.train import WEIGHTS

    folds, spread = fold_spread(config)
    if folds:
        means = _listed({name: f"{mean:.4f} ± {sd:.4f}" for name, (mean, sd) in spread.items()})
        print(f"folds {', '.join(map(str, folds))}: {means}")
    print(
        f"weights: {Path(config.train.folder) / WEIGHTS}, for method.weights=[…] of symshrec evaluate "
        "or for train.init=… of a training that starts from them"
    )


def _listed(figures: dict[str, str]) -> str:
    return ", ".join(f"{name.removeprefix('val/')} {value}" for name, value in figures.items())
