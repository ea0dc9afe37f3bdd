"""What M1 and M2 share: a network on sampled points, its training and its weights."""

from abc import abstractmethod
from dataclasses import is_dataclass, replace
from typing import Any

import torch
from torch import Tensor, nn

from symshrec.data.batch import Batch, SampledBatch
from symshrec.geometry.sampling import farthest_point_sampling
from symshrec.methods.base import SymmetryMethod
from symshrec.methods.optimiser import OptimiserSettings
from symshrec.methods.settings import LearnedSettings, plain_settings, restored_settings
from symshrec.methods.weights import Weights, WeightsError, check_fit, load_into, read_weights
from symshrec.metrics.torchmetric import SymmetryMetric
from symshrec.planes import Planes


class LearnedMethod(SymmetryMethod):
    """A method with a network over N sampled points of a cloud.

    Its settings derive from `LearnedSettings` and have a `network`, a dataclass of scalars, Enums and tuples with the
    field `points`. A method implements `network_of`, `losses` and `detect_sampled`.

    Weights bring the network that they belong to, and the settings named in `DETECTION` that their training was judged
    with: those which were left at their defaults are the weights' own.

    Raises:
        WeightsError: for weights that cannot be used, or of different networks.
    """

    name: str  # of the method, in weights files
    Settings: type[LearnedSettings] = LearnedSettings
    settings: LearnedSettings
    DETECTION: tuple[str, ...] = ()
    val_metric: SymmetryMetric  # of the validation that runs or ran last

    def __init__(self, settings: LearnedSettings | None = None):
        super().__init__(settings)
        self.weights = [read_weights(name, self.name) for name in self.settings.weights]
        self.settings = self._with_those_of_weights(self.settings)
        self.networks = nn.ModuleList(self.network_of(self.network_settings) for _ in range(len(self.weights) or 1))
        for network, weights in zip(self.networks, self.weights, strict=False):
            load_into(network, weights)
        self.optimiser, self.steps, self.seed, self.rotate = OptimiserSettings(), 1, 0, False
        self.cooldown_from: int | None = None

    @abstractmethod
    def network_of(self, settings) -> nn.Module:
        """The network that these settings describe."""

    @abstractmethod
    def losses(self, batch: SampledBatch) -> dict[str, Tensor]:
        """The terms of the loss by name, the one to descend under `loss`."""

    @abstractmethod
    def detect_sampled(self, points: Tensor) -> list[Planes]:
        """The planes of clouds (B, N, 3) in the clouds' own coordinates."""

    @property
    def network_settings(self):
        """The network's settings: those of the weights, where there are any."""
        return self.settings.network

    def detection_settings(self) -> dict:
        """What a weights file keeps of the settings besides the network: those of `DETECTION`, plain."""
        plain = plain_settings(self.settings)
        return {name: plain[name] for name in self.DETECTION}

    def _with_those_of_weights(self, settings: LearnedSettings) -> LearnedSettings:
        kinds = {str(each.network): each for each in self.weights}
        if len(kinds) > 1:
            raise WeightsError(f"weights of different networks cannot answer together: {'; '.join(kinds)}")
        for weights in kinds.values():
            settings = replace(settings, network=self._settings_of(weights, type(settings.network)))
        given, default = plain_settings(settings), plain_settings(type(settings)())
        stored = [each.detection for each in self.weights]
        if any(each != stored[0] for each in stored):
            raise WeightsError("weights judged with different settings cannot answer together; give them one by one")
        for name, value in (stored[0] if stored else {}).items():
            if name in self.DETECTION and given[name] == default[name]:
                settings = replace(settings, **{name: _like(getattr(settings, name), value)})
        return settings

    def _settings_of(self, weights: Weights, kind: type):
        """The settings that weights bring with them, once a network by them, of no size in memory, fits the weights."""
        try:
            settings = restored_settings(kind, weights.network, len(weights.tensors))
            with torch.device("meta"):
                network = self.network_of(settings)
        except (ValueError, RuntimeError) as error:
            raise WeightsError(f"weights {weights.name!r}: no network is like theirs: {error}") from error
        check_fit(network, weights)
        return settings

    def start_from(self, name: str) -> Weights:
        """Take over shipped weights, or those in a file, before training; returns them with their record.

        Raises:
            WeightsError: for weights that are not there or do not fit.
        """
        weights = read_weights(name, self.name)
        load_into(self.networks[0], weights)
        return weights

    @property
    def points(self) -> int:
        """N, the points that the network sees."""
        return self.network_settings.points

    @property
    def weights_record(self) -> list[dict[str, str]] | None:
        """What metrics.json says of the weights."""
        return [{"name": each.name, "sha256": each.sha256, "about": each.about} for each in self.weights] or None

    def detect(self, points: Tensor) -> Planes:
        """The planes of one cloud (N, 3).

        Raises:
            ValueError: for a wrong shape, values that are not finite, or a network without weights.
        """
        if points.ndim != 2 or points.shape[1] != 3 or not len(points):
            raise ValueError(f"points have shape {tuple(points.shape)}, expected (N ≥ 1, 3)")
        if not points.isfinite().all():
            raise ValueError("points hold values that are not finite; remove them")
        return self._detect_all(points.float(), torch.tensor([len(points)], device=points.device))[0]

    def detect_batch(self, batch: Batch) -> list[Planes]:
        """The planes of every cloud, in order; drawn samples are used where there are as many as the network sees."""
        if batch.samples is not None and batch.samples.shape[1] == self.points:
            self._require_weights()
            with torch.no_grad():
                return self.detect_sampled(batch.sampled)
        return self._detect_all(batch.points, batch.lengths)

    def _detect_all(self, points: Tensor, lengths: Tensor) -> list[Planes]:
        self._require_weights()
        chosen = farthest_point_sampling(points, lengths, self.points)
        starts = lengths.cumsum(0) - lengths
        with torch.no_grad():
            return self.detect_sampled(points[starts[:, None] + chosen])

    def _require_weights(self) -> None:
        if not self.weights:
            raise ValueError(f"{self.name} has no weights; name some with method.weights, or train it first")

    def learn_by(
        self, optimiser: OptimiserSettings, steps: int, seed: int, rotate: bool, cooldown_from: int | None = None
    ) -> None:
        """Say how the coming training goes: its optimiser, its number of steps, the seed, whether clouds are turned,
        and the step from which a constant learning rate cools down."""
        self.optimiser, self.steps, self.seed, self.rotate = optimiser, steps, seed, rotate
        self.cooldown_from = cooldown_from

    def configure_optimizers(self) -> dict:
        named = [(each, each.ndim > 1 and not name.endswith("bias")) for name, each in self.named_parameters()]
        decayed, others = ([each for each, decays in named if decays is wanted] for wanted in (True, False))
        decay = self.optimiser.weight_decay
        groups: list[dict[str, Any]] = [{"params": decayed, "weight_decay": decay}, {"params": others}]
        adamw = torch.optim.AdamW(groups, self.optimiser.learning_rate, weight_decay=0.0, fused=True)
        schedule = torch.optim.lr_scheduler.LambdaLR(
            adamw, lambda step: self.optimiser.factor(step, self.steps, self.cooldown_from)
        )
        return {"optimizer": adamw, "lr_scheduler": {"scheduler": schedule, "interval": "step"}}

    def training_step(self, batch: SampledBatch, batch_idx: int) -> Tensor:
        """Chance depends on the step and the process alone, so that a resumed run draws what it would have drawn."""
        torch.manual_seed(hash((self.seed, self.global_step, self.global_rank)) % 2**31)
        losses = self.losses(batch.turned() if self.rotate else batch)
        if not losses["loss"].isfinite():
            terms = ", ".join(f"{name} {value.item():.4g}" for name, value in losses.items())
            raise FloatingPointError(
                f"the loss of step {self.global_step} is not finite ({terms}); lower train.optimiser.learning_rate, or "
                "take trainer.precision=32-true; the last checkpoint is from before this step"
            )
        self.log_dict({f"train/{name}": value.detach() for name, value in losses.items()}, batch_size=len(batch))
        return losses["loss"]

    def on_before_optimizer_step(self, optimizer: torch.optim.Optimizer) -> None:
        """Clip the gradient here, since Lightning refuses to for fused optimizers."""
        norm = nn.utils.clip_grad_norm_(self.parameters(), self.optimiser.clip)
        self.log("train/gradient_norm", norm)

    def on_validation_epoch_start(self) -> None:
        self.val_metric = SymmetryMetric(count_threshold=self.count_threshold, curves=False)

    def validation_step(self, batch: Batch, batch_idx: int) -> list[Planes]:
        """Loss and scores of a batch; returns its planes, for callbacks to show."""
        losses = self.losses(SampledBatch.of(batch.sampled, batch.truth))
        self.log_dict({f"val/{name}": value for name, value in losses.items()}, batch_size=len(batch), sync_dist=True)
        planes = self.detect_sampled(batch.sampled)
        self.log("val/planes", sum(map(len, planes)) / len(planes), batch_size=len(batch), sync_dist=True)
        if all(truth is not None for truth in batch.truth):
            self.val_metric.update(planes, batch.truth, batch.diagonals, batch.labels, batch.positions)
        return planes

    def on_validation_epoch_end(self) -> None:
        if self.val_metric.clouds:
            means = self.val_metric.compute()
            self.log_dict({f"val/{name}": float(value) for name, value in means.items()}, sync_dist=True)


def _like(setting, plain):
    """A plain value as what the setting is: a dataclass restored, anything else as it is."""
    return restored_settings(type(setting), plain) if is_dataclass(setting) else plain
