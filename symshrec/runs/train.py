"""One training: a learned method over a fold, killed at any moment and resumed to the same weights."""

import hashlib
import json
import logging
import math
import time
import warnings
from collections.abc import Iterator
from pathlib import Path

import torch
from lightning import Callback, Trainer, seed_everything
from lightning.pytorch.callbacks import LearningRateMonitor, ModelCheckpoint, TQDMProgressBar
from omegaconf import DictConfig, OmegaConf

from symshrec.data.datamodule import SymmetryDataModule
from symshrec.data.settings import SamplingKind
from symshrec.files.atomic import write_atomically
from symshrec.methods.learned import LearnedMethod, plain_settings
from symshrec.methods.optimiser import Schedule
from symshrec.methods.weights import write_weights
from symshrec.runs.config import method_of
from symshrec.runs.evaluate import datamodule_of
from symshrec.runs.provenance import code_version, hardware, peak_memory_mib
from symshrec.runs.trainer import TRAINING_SHORTENED, checked_start, devices_of, shortened, trainer_of

log = logging.getLogger(__name__)
WEIGHTS, CHECKPOINT, RECORD, SETTINGS = "weights.safetensors", "last.ckpt", "training.json", "settings.json"
EVERY_ROUND = {"every_n_epochs": 1, "save_on_train_epoch_end": True}
NO_INFLUENCE = (  # beginnings of keys
    "data.batch_size",
    "data.hard",
    "data.root",
    "data.test_split",
    "data.validation_clouds",
    "data.verify",
    "data.workers",
    "method.cleaning",
    "method.confidence",
    "method.count_threshold",
    "method.decode",
    "method.refine",
    "method.twice",
    "method.workers",
    "train.clouds_shown",
    "train.folder",
    "train.max_minutes",
    "train.precision",
    "train.validate_every",
    "trainer.enable_progress_bar",
    "trainer.log_every_n_steps",
    "trainer.max_time",
    "trainer.precision",
)


def train(config: DictConfig) -> dict | None:
    """Train, or go on, in `config.train.folder`: last.ckpt, TensorBoard, weights.safetensors and, last, training.json.

    A killed run loses at most the round it was in, and ends with the weights that it would have had anyway.

    Returns:
        What training.json holds; None where `train.max_minutes` ended it before the last round, and in all processes
        but the first. Of a partial training (`trainer.fast_dev_run`, `max_steps` and so on), which leaves no weights,
        its validation, with the arguments that shortened it as `partial`.

    Raises:
        ValueError: where the folder holds a training of other settings, or the method has nothing to train.
    """
    if "weights" not in config.method:
        raise ValueError(f"method={config.method.name} has nothing to train")
    config = config.copy()
    config.method.weights = []
    config.train.precision = chosen_precision(config.train.precision, config.trainer.accelerator)
    config.trainer.precision = config.train.precision
    if config.data.sampling.kind is SamplingKind.none:  # the network draws its points itself, but not in every epoch
        config.data.sampling.kind = SamplingKind.farthest
        config.data.sampling.points = config.method.network.points
    if why := shortened(config, TRAINING_SHORTENED):
        return _partial(config, Path(config.train.folder) / "partial", why)
    folder = Path(config.train.folder) if config.train.cooldown is None else branch_off(config)
    settings = decisive_settings(config)
    _refuse_others(folder, settings)
    finished = _read(folder / RECORD)
    if finished:
        log.info("%s is trained: %s", config.title, folder / WEIGHTS)
        return finished
    seed_everything(config.seed, workers=True, verbose=False)
    method, data = method_of(config), datamodule_of(config)
    rounds, before = _prepare(config, method, data, folder)
    progress, last = Progress(config.train.max_minutes), folder / CHECKPOINT
    start = str(last) if last.exists() else checked_start(config.ckpt_path, method)
    folder.mkdir(parents=True, exist_ok=True)
    write_atomically(folder / SETTINGS, (json.dumps(settings, indent=1) + "\n").encode())
    keeper = ModelCheckpoint(folder, filename=last.stem, enable_version_counter=False, **EVERY_ROUND)
    trainer = _trainer(config, folder, rounds, progress, keeper)
    trainer.fit(method, datamodule=data, ckpt_path=start, weights_only=True)
    if trainer.current_epoch < rounds:
        log.info("stopped after round %d of %d; the same command goes on", trainer.current_epoch, rounds)
        return None
    result = _record(config, method, data, trainer, progress, settings, before)
    if not trainer.is_global_zero:
        return None
    weights, network = folder / WEIGHTS, method.networks[0]
    write_weights(weights, method.name, plain_settings(method.network_settings), result, network.state_dict())
    result["weights_sha256"] = hashlib.sha256(weights.read_bytes()).hexdigest()
    write_atomically(folder / RECORD, (json.dumps(result, indent=1) + "\n").encode())
    return result


def _partial(config: DictConfig, folder: Path, why: list[str]) -> dict:
    """Train and validate as far as a shortened training goes, and store none of it; loggers alone write in `folder`."""
    if config.train.cooldown is not None:
        raise ValueError(f"trainer.{why[0]} and train.cooldown do not go together: a cool-down is a whole training")
    seed_everything(config.seed, workers=True, verbose=False)
    method, data = method_of(config), datamodule_of(config)
    rounds, _ = _prepare(config, method, data, folder)
    progress = Progress(config.train.max_minutes)
    trainer = _trainer(config, folder, rounds, progress)
    trainer.fit(method, datamodule=data, ckpt_path=checked_start(config.ckpt_path, method), weights_only=True)
    steps = trainer.global_step
    trainer.validate(method, datamodule=data, verbose=False)
    return {
        "name": config.title,
        "method": config.method.name,
        "run": config.run.name,
        "partial": why,
        "clouds": progress.clouds,
        "steps": steps,
        "validation": _validation(trainer),
    }


def chosen_precision(asked: str, accelerator: str) -> str:
    """`asked`, or for `auto` what the device is made for: bfloat16 on GPUs and on CPUs with instructions for it.

    Without them, as on processors with AVX2 alone, PyTorch's bfloat16 products are tens of times slower than float32.
    """
    if asked != "auto":
        return asked
    pays = accelerator != "cpu" or torch.ops.mkldnn._is_mkldnn_bf16_supported()
    return "bf16-mixed" if pays else "32-true"


def branch_off(config: DictConfig) -> Path:
    """The folder of a cool-down from the training in `train.folder`: one begun and unfinished, or a new one that starts
    with the training's last checkpoint.

    Raises:
        ValueError: where there is no checkpoint yet, or the learning rate is not constant.
    """
    trunk = Path(config.train.folder)
    if config.train.optimiser.schedule is not Schedule.constant:
        raise ValueError("train.cooldown is for train.optimiser.schedule=constant; a cosine ends by itself")
    if not config.train.cooldown > 0:
        raise ValueError(f"train.cooldown is {config.train.cooldown}; it must be a positive number of epochs")
    for branch in sorted(trunk.glob("cooldown_*")):
        if not (branch / RECORD).exists() and (branch / CHECKPOINT).exists():
            return branch
    if not (trunk / CHECKPOINT).exists():
        raise ValueError(f"{trunk / CHECKPOINT} does not exist; train first, without train.cooldown")
    branch = trunk / f"cooldown_{_steps_done(trunk) // config.train.steps_per_round:05d}"
    branch.mkdir(exist_ok=True)
    if not (branch / CHECKPOINT).exists():
        write_atomically(branch / CHECKPOINT, (trunk / CHECKPOINT).read_bytes())
    return branch


def _steps_done(folder: Path) -> int:
    """Steps that the checkpoint in a training's folder has behind it."""
    return torch.load(folder / CHECKPOINT, map_location="cpu", weights_only=True)["global_step"]


def decisive_settings(config: DictConfig) -> dict[str, object]:
    """All that decides the weights, by dotted key; plain values."""
    nodes = {name: config[name] for name in ("data", "method", "train", "trainer")}
    plain = {name: OmegaConf.to_container(node, resolve=True, enum_to_str=True) for name, node in nodes.items()}
    flat = dict(_flattened(plain | {"seed": config.seed}))
    if config.ckpt_path is not None and Path(config.ckpt_path).is_file():
        flat["ckpt_path"] = hashlib.sha256(Path(config.ckpt_path).read_bytes()).hexdigest()
    return {key: value for key, value in flat.items() if not key.startswith(NO_INFLUENCE)}


def _flattened(node: object, prefix: str = "") -> Iterator[tuple[str, object]]:
    if not isinstance(node, dict):
        yield prefix.removesuffix("."), node
        return
    for key, value in node.items():
        yield from _flattened(value, f"{prefix}{key}.")


def _refuse_others(folder: Path, settings: dict[str, object]) -> None:
    """Raises ValueError where the folder holds a training by other settings."""
    there = _read(folder / SETTINGS)
    if there is None or there == settings:
        return
    differing = sorted(key for key in there.keys() | settings.keys() if there.get(key) != settings.get(key))
    raise ValueError(
        f"{folder} holds a training with other settings ({', '.join(differing)}); name another train.folder, or remove "
        "that one"
    )


def _prepare(config: DictConfig, method: LearnedMethod, data: SymmetryDataModule, folder: Path) -> tuple[int, dict]:
    """Give the method its schedule and what it starts from; returns the rounds of the training, and what is known of
    the training that it goes on from, empty where it starts from chance."""
    settings = config.train
    epochs = settings.epochs if settings.cooldown is None else settings.cooldown
    steps = math.ceil(epochs * data.training_clouds() / (settings.batch_size * devices_of(config)))
    rounds, start = math.ceil(steps / settings.steps_per_round), None
    if settings.cooldown is not None:
        begun = int(folder.name.removeprefix("cooldown_"))
        rounds, start = rounds + begun, begun * settings.steps_per_round
    optimiser = OmegaConf.to_object(settings.optimiser)
    method.learn_by(optimiser, rounds * settings.steps_per_round, config.seed, settings.rotate, start)
    before = {}
    if settings.init:
        weights = method.start_from(settings.init)
        earlier = weights.training.get("before", {})
        before = {
            "weights": weights.name if not weights.name.endswith(".safetensors") else Path(weights.name).name,
            "sha256": weights.sha256,
            "data": weights.training["data"],
            "clouds": weights.training["clouds"] + earlier.get("clouds", 0),
            "epochs": round(weights.training["epochs"] + earlier.get("epochs", 0), 3),
            "seconds": weights.training["seconds"] + earlier.get("seconds", 0),
        }
    if settings.compile:
        method.networks[0].compile()
    return rounds, before


class Progress(Callback):
    """Counts clouds, seconds, and the share of them that steps waited for data, over all sessions of a training.

    Args:
        max_minutes: of this session; the round in which they pass is its last. None sets no limit.
    """

    def __init__(self, max_minutes: float | None):
        self.clouds, self.seconds, self.waited = 0, 0.0, 0.0
        self._mark = self._end = 0.0
        self._stop = math.inf if max_minutes is None else time.perf_counter() + 60 * max_minutes

    def state_dict(self) -> dict[str, float]:
        return {"clouds": self.clouds, "seconds": self.seconds, "waited": self.waited}

    def load_state_dict(self, state: dict[str, float]) -> None:
        self.clouds, self.seconds, self.waited = state["clouds"], state["seconds"], state["waited"]

    def on_train_epoch_start(self, trainer, method) -> None:
        self._mark = self._end = time.perf_counter()

    def on_train_batch_start(self, trainer, method, batch, batch_idx) -> None:
        self.waited += time.perf_counter() - self._end

    def on_train_batch_end(self, trainer, method, outputs, batch, batch_idx) -> None:
        self._end = time.perf_counter()
        self.clouds += len(batch) * trainer.world_size

    def on_train_epoch_end(self, trainer, method) -> None:
        self.seconds += self._end - self._mark
        shares = {"clouds_per_second": self.clouds, "share_waiting_for_data": self.waited}
        seconds = max(self.seconds, 1e-9)
        method.log_dict({f"train/{name}": value / seconds for name, value in shares.items()}, sync_dist=True)
        trainer.should_stop = trainer.strategy.broadcast(time.perf_counter() > self._stop)


def _trainer(config: DictConfig, folder: Path, rounds: int, *callbacks: Callback) -> Trainer:
    warnings.filterwarnings("ignore", message=".*does not have many workers")  # the training set is in memory
    warnings.filterwarnings("ignore", message="The dirpath has changed")  # a cool-down goes on in its own folder
    warnings.filterwarnings("ignore", message="Checkpoint directory .* exists and is not empty")
    settings, shown = config.train, []
    if config.trainer.enable_progress_bar:
        shown.append(TQDMProgressBar(refresh_rate=20))
    if config.logger:
        shown.append(LearningRateMonitor("step"))
    return trainer_of(
        config,
        folder,
        [*callbacks, *shown],
        max_epochs=rounds,
        check_val_every_n_epoch=settings.validate_every,
        num_sanity_val_steps=0,
        log_every_n_steps=min(50, settings.steps_per_round),
        use_distributed_sampler=False,
        enable_model_summary=False,
        enable_checkpointing=any(isinstance(each, ModelCheckpoint) for each in callbacks),
    )


def _record(
    config, method: LearnedMethod, data, trainer: Trainer, progress: Progress, settings: dict, before: dict
) -> dict:
    """How the weights came about, and what the validating fold says of them."""
    trainer.validate(method, datamodule=data, verbose=False)
    split = data.split("train")
    return {
        "name": config.title,
        "method": config.method.name,
        "run": config.run.name,
        "fold": config.data.fold,
        "data": {"name": f"{config.data.name}{config.data.variant}", "manifest_sha256": split.fingerprint},
        "clouds": progress.clouds,
        "epochs": round(progress.clouds / len(data.datasets["train"]), 3),
        "steps": trainer.global_step,
        "seconds": round(progress.seconds, 1),
        "share_waiting_for_data": round(progress.waited / max(progress.seconds, 1e-9), 5),
        "validation": _validation(trainer),
        "validation_clouds": len(data.datasets["val"]),
        "seed": config.seed,
        **({"before": before} if before else {}),
        "settings": settings,
        "precision": config.train.precision,
        "hardware": hardware(),
        "peak_memory_mib": peak_memory_mib(),
        "code": code_version(),
    }


def _validation(trainer: Trainer) -> dict[str, float]:
    """The figures of the last validation."""
    metrics = sorted(trainer.callback_metrics.items())
    return {name: round(float(value), 5) for name, value in metrics if name.startswith("val/")}


def _read(path: Path) -> dict | None:
    try:
        return json.loads(path.read_text())
    except (OSError, ValueError):
        return None
