"""One training: a learned method over a fold, killed at any moment and resumed to the same weights."""

import hashlib
import json
import logging
import math
import warnings
from contextlib import suppress
from pathlib import Path

import torch
from lightning import Callback, Trainer, seed_everything
from lightning.pytorch.callbacks import LearningRateMonitor, TQDMProgressBar
from omegaconf import DictConfig

from symshrec.data.datamodule import SymmetryDataModule
from symshrec.data.settings import SamplingKind
from symshrec.files.atomic import write_atomically
from symshrec.methods.learned import LearnedMethod
from symshrec.methods.optimiser import Schedule
from symshrec.methods.registry import method_class
from symshrec.methods.settings import plain_settings
from symshrec.methods.weights import write_weights
from symshrec.runs.checkpoints import (
    LAST,
    VerifiedCheckpoints,
    begun,
    copy_newest,
    forget_previous,
    settle,
    steps_done,
)
from symshrec.runs.config import method_of, settings_of
from symshrec.runs.evaluate import datamodule_of
from symshrec.runs.folders import claimed, is_first_process, is_of_this_root, refuse_other_data
from symshrec.runs.provenance import code_version, hardware, peak_memory_mib
from symshrec.runs.session import Progress, TimedCheckpoints, TimeIsUp
from symshrec.runs.trainer import TRAINING_SHORTENED, checked_start, devices_of, shortened, trainer_of
from symshrec.runs.training_identity import SETTINGS, read_json, refuse_other_settings, training_identity

log = logging.getLogger(__name__)
WEIGHTS, RECORD = "weights.safetensors", "training.json"


def train(config: DictConfig) -> dict | None:
    """Train, or go on, in `config.train.folder`: last.ckpt, TensorBoard, weights.safetensors and, last, training.json.

    A killed run loses at most `train.checkpoint_minutes`, and ends with the weights that it would have had anyway.

    Returns:
        What training.json holds; None where `train.max_minutes` ended it before the last round, and in all processes
        but the first. Of a partial training (`trainer.fast_dev_run`, `max_steps` and so on), which leaves no weights,
        its validation, with the arguments that shortened it as `partial`.

    Raises:
        ValueError: where the folder holds a training of other settings or data, or the method has nothing to train.
        FolderInUseError: where another process trains in this folder. CheckpointError: where no checkpoint is sound.
    """
    if not issubclass(method_class(config.method.name), LearnedMethod):
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
    with claimed(folder):
        return _trained(config, folder)


def _trained(config: DictConfig, folder: Path) -> dict | None:
    """`train` in a folder that no other process writes in."""
    settings = training_identity(config)
    refuse_other_settings(folder, settings)
    finished = read_json(folder / RECORD)
    if finished:
        if not is_of_this_root(folder, config):
            refuse_other_data(folder, config, datamodule_of(config).split("train").fingerprint)
        log.info("%s is trained: %s", config.title, folder / WEIGHTS)
        return finished
    seed_everything(config.seed, workers=True, verbose=False)
    method, data = _learner_of(config), datamodule_of(config)
    rounds, before = _prepare(config, method, data, folder)
    refuse_other_data(folder, config, data.split("train").fingerprint, going_on=True)
    start = checked_start(config.ckpt_path, method)
    if is_first_process():
        write_atomically(folder / SETTINGS, (json.dumps(settings, indent=1) + "\n").encode())
        if config.train.cooldown is not None and not begun(folder):
            copy_newest(Path(config.train.folder), folder)
        settle(folder)
    progress, last = Progress(), folder / LAST
    start = str(last) if begun(folder) else start
    keeper = TimedCheckpoints(last, config.train.checkpoint_minutes, config.train.max_minutes)
    trainer = _trainer(config, folder, rounds, progress, keeper)
    with suppress(TimeIsUp):
        trainer.fit(method, datamodule=data, ckpt_path=start, weights_only=True)
    steps = rounds * config.train.steps_per_round
    if trainer.global_step < steps:
        if trainer.is_global_zero:
            log.info("stopped after step %d of %d; the same command goes on", trainer.global_step, steps)
        return None
    result = _record(config, method, data, trainer, progress, settings, before)
    if not trainer.is_global_zero:
        return None
    weights, network = folder / WEIGHTS, method.networks[0]
    plain, detection = plain_settings(method.network_settings), method.detection_settings()
    write_weights(weights, method.name, plain, result, network.state_dict(), detection=detection)
    result["weights_sha256"] = hashlib.sha256(weights.read_bytes()).hexdigest()
    write_atomically(folder / RECORD, (json.dumps(result, indent=1) + "\n").encode())
    forget_previous(folder)
    return result


def _partial(config: DictConfig, folder: Path, why: list[str]) -> dict:
    """Train and validate as far as a shortened training goes, and store none of it; loggers alone write in `folder`."""
    if config.train.cooldown is not None:
        raise ValueError(f"trainer.{why[0]} and train.cooldown do not go together: a cool-down is a whole training")
    seed_everything(config.seed, workers=True, verbose=False)
    method, data = _learner_of(config), datamodule_of(config)
    rounds, _ = _prepare(config, method, data, folder)
    progress = Progress()
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
    with the training's last checkpoint. The rate falls from the end of that checkpoint's round on.

    Raises:
        ValueError: where there is no checkpoint yet, or the learning rate is not constant.
    """
    trunk = Path(config.train.folder)
    if config.train.optimiser.schedule is not Schedule.constant:
        raise ValueError("train.cooldown is for train.optimiser.schedule=constant; a cosine ends by itself")
    if not config.train.cooldown > 0:
        raise ValueError(f"train.cooldown is {config.train.cooldown}; it must be a positive number of epochs")
    for branch in sorted(trunk.glob("cooldown_*")):
        if not (branch / RECORD).exists() and begun(branch):
            return branch
    if not begun(trunk):
        raise ValueError(f"{trunk / LAST} does not exist; train first, without train.cooldown")
    return trunk / f"cooldown_{math.ceil(steps_done(trunk) / config.train.steps_per_round):05d}"


def _learner_of(config: DictConfig) -> LearnedMethod:
    method = method_of(config)
    assert isinstance(method, LearnedMethod)  # `train` refuses all others
    return method


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
    optimiser = settings_of(settings.optimiser)
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


def _trainer(config: DictConfig, folder: Path, rounds: int, *callbacks: Callback) -> Trainer:
    warnings.filterwarnings("ignore", message=".*does not have many workers")  # a step hardly waits: see Progress
    warnings.filterwarnings("ignore", message="Be aware that when using `ckpt_path`")  # of Lightning's own checkpoints
    warnings.filterwarnings("ignore", message=".*your dataloader is not resumable")  # RoundSampler is, by its `first`
    settings = config.train
    shown: list[Callback] = []
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
        plugins=[VerifiedCheckpoints()],
        enable_model_summary=False,
        enable_checkpointing=any(isinstance(each, TimedCheckpoints) for each in callbacks),
    )


def _record(
    config, method: LearnedMethod, data, trainer: Trainer, progress: Progress, settings: dict, before: dict
) -> dict:
    """How the weights came about, and what the validating fold says of them."""
    trainer.validate(method, datamodule=data, verbose=False)
    return {
        "name": config.title,
        "method": config.method.name,
        "run": config.run.name,
        "fold": config.data.fold,
        "data": _data_record(config, data),
        "clouds": progress.clouds,
        "epochs": round(progress.clouds / data.training_clouds(), 3),
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


def _data_record(config: DictConfig, data: SymmetryDataModule) -> dict:
    """What was learnt from: data with a manifest, or a stream, known by what its clouds are made from."""
    name, known = f"{config.data.name}{config.data.variant}", data.split("train").fingerprint
    return (
        {"name": f"{name}, streamed", "stream_sha256": known}
        if config.data.stream
        else {"name": name, "manifest_sha256": known}
    )


def _validation(trainer: Trainer) -> dict[str, float]:
    """The figures of the last validation."""
    metrics = sorted(trainer.callback_metrics.items())
    return {name: round(float(value), 5) for name, value in metrics if name.startswith("val/")}
