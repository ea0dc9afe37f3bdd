"""What a test run leaves in TensorBoard: its scores, its precision-recall curve, and a few clouds with their planes."""

import numpy as np
from lightning import Callback, Trainer
from lightning.pytorch.loggers import TensorBoardLogger
from matplotlib.figure import Figure
from torch import from_numpy

from symshrec.data.batch import Batch
from symshrec.methods.base import SymmetryMethod
from symshrec.methods.m2.autoencoder import Reconstruction
from symshrec.metrics import Scores, grouped
from symshrec.planes import Planes
from symshrec.reporting.figures.drawing import PREDICTED, TRUE, cloud_mesh, draw_cloud
from symshrec.reporting.figures.figures import draw_precision_recall
from symshrec.reporting.tables.results import EPSILON, THETA_DEG

MATERIAL = {"material": {"cls": "MeshBasicMaterial", "color": "#ffffff"}}  # unlit: frames have no normal


class TensorBoardResults(Callback):
    """Logs, at the end of a test, to every TensorBoardLogger of the trainer.

    Scalars `mAP/all`, `mAP/P0`, `mAP/astroid` and so on for every metric and group at θ = 1°, ε = 1% (or the nearest
    that was scored); the method's hyperparameters beside the overall scores; the precision-recall curve; and the first
    clouds with their true planes in blue and the planes the method means to count in vermilion, as figures and meshes.

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
                _log_scores(logger, pl_module, scores, labels)
                for cloud in self._shown:
                    _log_cloud(logger, *cloud)
                logger.experiment.flush()


class TensorBoardTraining(Callback):
    """Logs, at every validation, the same few clouds with their true and predicted planes; hyperparameters at the end.

    Of a pre-training, the clouds with the patches that were hidden, as they are and as they were told.

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
            trainer.logger.log_hyperparams({"method": type(pl_module).__name__, **pl_module.hparams}, scores)
            trainer.logger.experiment.flush()


def _planes(batch: Batch, row: int, counted: Planes) -> Figure:
    figure = Figure(figsize=(5, 5), layout="constrained")
    true = batch.truth[row] or Planes.empty()
    title = f"{batch.names[row]}, {len(true)} true, {len(counted)} predicted"
    draw_cloud(figure.subplots(), batch.clouds[row].cpu().numpy(), true, counted, title=title)
    return figure


def _reconstruction(answer: Reconstruction, row: int) -> Figure:
    """Side by side: the patches seen, those and what was told of the hidden ones, those and the hidden ones."""
    figure = Figure(figsize=(12, 4), layout="constrained")
    seen, told, hidden = (
        each[row].flatten(0, 1).float().cpu().numpy() for each in (answer.visible, answer.predicted, answer.hidden)
    )
    parts = {"seen": seen, "told": np.concatenate([seen, told]), "true": np.concatenate([seen, hidden])}
    for ax, (title, points) in zip(figure.subplots(1, 3), parts.items(), strict=True):
        draw_cloud(ax, points, title=title)
    return figure


def _log_scores(logger: TensorBoardLogger, method: SymmetryMethod, scores: Scores, labels: list) -> None:
    theta = int(np.abs(scores.thetas_deg - THETA_DEG).argmin())
    epsilon = int(np.abs(scores.epsilons - EPSILON).argmin())
    tolerance = float(scores.thetas_deg[theta]), float(scores.epsilons[epsilon])
    for score in grouped(scores, labels):
        if (score.theta_deg, score.epsilon) == tolerance:
            logger.experiment.add_scalar(f"{score.metric}/{score.group}", score.value, 0)
    logger.log_hyperparams({"method": type(method).__name__, **method.hparams}, scores.mean(theta, epsilon))
    if scores.curve is not None:
        figure = Figure(figsize=(5.4, 4.2), layout="constrained")
        ax = figure.subplots()
        draw_precision_recall(ax, {type(method).__name__: scores.mean_curve(theta, epsilon)})
        ax.set_title(f"θ = {tolerance[0]:g}°, ε = {tolerance[1]:.3g} of the diagonal", fontsize=11)
        logger.experiment.add_figure("precision_recall", figure, 0)


def _log_cloud(
    logger: TensorBoardLogger, name: str, points: np.ndarray, true: Planes | None, predicted: Planes
) -> None:
    true = Planes.empty() if true is None else true
    figure = Figure(figsize=(5, 5), layout="constrained")
    title = f"{name}\n{len(true)} true, {len(predicted)} predicted"
    draw_cloud(figure.subplots(), points, true, predicted, title=title)
    logger.experiment.add_figure(f"clouds/{name}", figure, 0)
    mesh = cloud_mesh(points, [(true, TRUE), (predicted, PREDICTED)])
    tensors = {key: from_numpy(values)[None] for key, values in mesh.items()}
    logger.experiment.add_mesh(f"clouds_3d/{name}", **tensors, config_dict=MATERIAL, global_step=0)
