"""What a test run leaves in TensorBoard: its scores, its precision-recall curve, and a few clouds with their planes."""

import re

import numpy as np
from lightning import Callback, Trainer
from lightning.pytorch.loggers import TensorBoardLogger
from matplotlib.figure import Figure

from symshrec.benchmark.cloud import UNKNOWN, Labels
from symshrec.data.batch import Batch
from symshrec.methods.base import SymmetryMethod
from symshrec.methods.m2.autoencoder import Reconstruction
from symshrec.methods.settings import changed_settings, plain_settings
from symshrec.metrics import METRICS, GroupScore, Scores, grouped
from symshrec.planes import Planes
from symshrec.reporting.figures.drawing import PREDICTED, TRUE, draw_cloud
from symshrec.reporting.figures.figures import draw_precision_recall
from symshrec.reporting.tables.results import EPSILON, THETA_DEG

SHORT = 4  # letters of a name that fits below a bar


class TensorBoardResults(Callback):
    """Logs, at the end of a test, to every TensorBoardLogger of the trainer.

    The metrics over all clouds as scalars `overall/mAP` and so on, at θ = 1°, ε = 1% (or the nearest that was scored);
    a figure of all metrics by perturbation, one by family and one by solid, with the overall value as a line and
    standard errors; the method and the settings that are not its default ones beside the scores, for comparison; the
    precision-recall curve; and the first clouds with their true planes in blue and the planes the method means to count
    in vermilion.

    Args:
        clouds: how many to show; 0 shows none.

    Raises:
        ValueError: for a negative number of clouds.
    """

    def __init__(self, clouds: int = 6):
        if clouds < 0:
            raise ValueError(f"tensorboard.clouds is {clouds}; give 0 or more")
        self.clouds = clouds
        self._shown: list[tuple[str, np.ndarray, Planes | None, Planes]] = []

    def on_test_start(self, trainer: Trainer, pl_module: SymmetryMethod) -> None:
        self._shown = []

    def on_test_batch_end(
        self, trainer: Trainer, pl_module: SymmetryMethod, outputs: list[Planes], batch: Batch, *_, **__
    ) -> None:
        """Keep the first clouds of the run; `outputs` are the planes found in each cloud of the batch."""
        wanted = max(0, self.clouds - len(self._shown))
        for row, (points, found) in enumerate(zip(batch.clouds[:wanted], outputs, strict=False)):
            counted = found[found.confidences >= pl_module.count_threshold]
            labels = batch.labels[row]
            name = f"{batch.positions[row]:05d} {labels.family} {labels.solid} {labels.perturbation}"
            self._shown.append((name, points.cpu().numpy(), batch.truth[row], counted))

    def on_test_end(self, trainer: Trainer, pl_module: SymmetryMethod) -> None:
        """Score what was seen and log it. Every process takes part in the scoring, the first one writes."""
        if pl_module.test_metric is None:
            return
        scores, labels, _ = pl_module.test_metric.evaluation()
        if not trainer.is_global_zero:
            return
        for logger in trainer.loggers:
            if isinstance(logger, TensorBoardLogger):
                _log_scores(logger, {**telling(pl_module), **_data(trainer)}, scores, labels)
                for cloud in self._shown:
                    _log_cloud(logger, *cloud)
                logger.experiment.flush()


class TensorBoardTraining(Callback):
    """Logs, at every validation, the same few clouds with their true and predicted planes; hyperparameters at the end.

    Of a pre-training, the clouds with the patches that were hidden, as they are and as they were predicted.

    Args:
        clouds: how many to show; 0 shows none.

    Raises:
        ValueError: for a negative number of clouds.
    """

    def __init__(self, clouds: int = 4):
        if clouds < 0:
            raise ValueError(f"train.clouds_shown is {clouds}; give 0 or more")
        self.clouds = clouds

    def on_validation_batch_end(
        self,
        trainer: Trainer,
        pl_module: SymmetryMethod,
        outputs: list[Planes] | Reconstruction,
        batch: Batch,
        batch_idx: int,
        *_,
    ) -> None:
        if batch_idx or not trainer.is_global_zero or not isinstance(trainer.logger, TensorBoardLogger):
            return
        for row, name in enumerate(batch.names[: self.clouds]):
            if isinstance(outputs, Reconstruction):
                figure = _reconstruction(outputs, row)
            else:
                found = outputs[row]
                figure = _planes(batch, row, found[found.confidences >= pl_module.count_threshold])
            trainer.logger.experiment.add_figure(f"clouds/{name}", figure, trainer.global_step)

    def on_train_end(self, trainer: Trainer, pl_module: SymmetryMethod) -> None:
        if trainer.is_global_zero and isinstance(trainer.logger, TensorBoardLogger):
            scores = {name: float(value) for name, value in trainer.callback_metrics.items() if name.startswith("val/")}
            trainer.logger.log_hyperparams({**telling(pl_module), **_data(trainer)}, scores, trainer.global_step)
            trainer.logger.experiment.flush()


def _planes(batch: Batch, row: int, counted: Planes) -> Figure:
    figure = Figure(figsize=(5, 5), layout="constrained")
    true = batch.truth[row] or Planes.empty()
    title = f"{batch.names[row]}, {len(true)} true, {len(counted)} predicted"
    draw_cloud(figure.subplots(), batch.clouds[row].cpu().numpy(), true, counted, title=title)
    return figure


def _reconstruction(answer: Reconstruction, row: int) -> Figure:
    """Side by side: the patches seen, those and what was predicted of the hidden ones, those and the hidden ones."""
    figure = Figure(figsize=(12, 4), layout="constrained")
    seen, predicted, hidden = (
        each[row].flatten(0, 1).float().cpu().numpy() for each in (answer.visible, answer.predicted, answer.hidden)
    )
    parts = {"seen": seen, "predicted": np.concatenate([seen, predicted]), "true": np.concatenate([seen, hidden])}
    for ax, (title, points) in zip(figure.subplots(1, 3), parts.items(), strict=True):
        draw_cloud(ax, points, title=title)
    return figure


def _log_scores(logger: TensorBoardLogger, about: dict, scores: Scores, labels: list) -> None:
    theta = int(np.abs(scores.thetas_deg - THETA_DEG).argmin())
    epsilon = int(np.abs(scores.epsilons - EPSILON).argmin())
    tolerance = float(scores.thetas_deg[theta]), float(scores.epsilons[epsilon])
    overall = {f"overall/{name}": value for name, value in scores.mean(theta, epsilon).items()}
    logger.log_hyperparams(about, overall, 0)  # which makes them scalars, too
    rows = [row for row in grouped(scores, labels) if (row.theta_deg, row.epsilon) == tolerance]
    for kind, groups in group_kinds(labels).items():
        logger.experiment.add_figure(f"scores/by {kind}", _by_group(rows, groups), 0)
    if scores.curve is not None:
        figure = Figure(figsize=(5.4, 4.2), layout="constrained")
        ax = figure.subplots()
        draw_precision_recall(ax, {about["method"]: scores.mean_curve(theta, epsilon)})
        ax.set_title(f"θ = {tolerance[0]:g}°, ε = {tolerance[1]:.3g} of the diagonal", fontsize=11)
        logger.experiment.add_figure("precision_recall", figure, 0)


def telling(method: SymmetryMethod) -> dict:
    """A run's hyperparameters that tell it from others: its method, and the settings that are not the default ones.

    Those of a method that saved hyperparameters of its own, in place of a settings class, are all there.
    """
    own = method.hparams.keys() - plain_settings(method.settings).keys()
    return {
        "method": type(method).__name__,
        **{name: method.hparams[name] for name in sorted(own)},
        **changed_settings(method.settings),
    }


def _data(trainer: Trainer) -> dict:
    data = getattr(trainer, "datamodule", None)
    return {} if data is None else {"data": data.settings.name}


def group_kinds(labels: list[Labels]) -> dict[str, list[str]]:
    """The groups that clouds are scored by, in their order: perturbations, families, solids; unknown ones are none."""
    kinds = {kind: {getattr(each, kind) for each in labels} - {UNKNOWN} for kind in ("perturbation", "family", "solid")}
    return {kind: sorted(names, key=_natural) for kind, names in kinds.items() if names}


def _natural(name: str) -> list:
    return [int(part) if part.isdecimal() else part for part in re.split(r"(\d+)", name)]


def _by_group(rows: list[GroupScore], groups: list[str]) -> Figure:
    """Bars of every metric, a group beside the other, with how far chance moves each."""
    figure = Figure(figsize=(max(5.0, 1.2 + 0.45 * len(groups)), 1.5 * len(METRICS) + 1), layout="constrained")
    for ax, metric in zip(figure.subplots(len(METRICS), 1, sharex=True), METRICS, strict=True):
        of_it = {row.group: row for row in rows if row.metric == metric}
        values = [of_it[group].value for group in groups]
        errors = [of_it[group].standard_error for group in groups]
        ax.bar(groups, values, yerr=errors, color=TRUE, width=0.7, error_kw={"lw": 0.8})
        ax.axhline(of_it["all"].value, color=PREDICTED, lw=1)
        ax.set(ylim=(0, 1), ylabel=metric.replace("recall_aware_", "recall-aware\n").replace("_", "\n"))
        ax.spines[["top", "right"]].set_visible(False)
        ax.tick_params(axis="x", rotation=90 if max(map(len, groups)) > SHORT else 0)
    return figure


def _log_cloud(
    logger: TensorBoardLogger, name: str, points: np.ndarray, true: Planes | None, predicted: Planes
) -> None:
    true = Planes.empty() if true is None else true
    figure = Figure(figsize=(5, 5), layout="constrained")
    title = f"{name}\n{len(true)} true, {len(predicted)} predicted"
    draw_cloud(figure.subplots(), points, true, predicted, title=title)
    logger.experiment.add_figure(f"clouds/{name}", figure, 0)
