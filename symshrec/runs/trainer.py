"""Lightning's Trainer as `trainer`, `logger` and `callbacks` of the configuration describe it."""

import inspect
import logging
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import torch
from hydra.errors import InstantiationException
from hydra.utils import get_object, instantiate
from lightning import Callback, Trainer
from lightning.pytorch.loggers import Logger, TensorBoardLogger
from lightning.pytorch.utilities.exceptions import MisconfigurationException
from omegaconf import DictConfig
from torch import nn

from symshrec.metrics import grouped
from symshrec.runs.schema import TrainerConfig

OWN_GROUPS = ("logger", "callbacks")
TEST_SHORTENED = ("fast_dev_run", "limit_test_batches", "barebones")
TRAINING_SHORTENED = (
    "fast_dev_run",
    "limit_train_batches",
    "limit_val_batches",
    "overfit_batches",
    "max_epochs",
    "max_steps",
    "barebones",
)
UNSHORTENED = (None, False, 1.0, 0.0, -1)  # what leaves a run whole; the numbers only in their own type
EXTRAS = ("wandb",)  # packages that pip install 'symshrec[…]' brings


def trainer_of(config: DictConfig, folder: Path, callbacks: Sequence[Callback], **arguments: Any) -> Trainer:
    """A Trainer with these callbacks, then the configured ones, that logs into `folder`.

    Args:
        arguments: of the Trainer, unless `config.trainer` has others.

    Raises:
        ValueError: naming the argument of `config.trainer` that Lightning does not know, or what it says of a wrong
            value; or the logger or callback that cannot be made.
    """
    warnings.filterwarnings("ignore", message=".*LeafSpec")  # Lightning's own, about torch
    warnings.filterwarnings("ignore", message="The `srun` command is available")  # where one job needs no SLURM
    logging.getLogger("lightning.pytorch").setLevel(logging.WARNING)
    asked = _asked(config)
    chosen = {"default_root_dir": str(folder)} | arguments | asked
    loggers = loggers_of(config, folder)
    try:
        return Trainer(
            **chosen, logger=loggers or False, callbacks=[*callbacks, *_instances("callbacks", config.callbacks)]
        )
    except (MisconfigurationException, TypeError, ValueError, RuntimeError, ImportError) as error:
        usual = asdict(TrainerConfig())
        given = ", ".join(f"trainer.{name}={value}" for name, value in asked.items() if usual.get(name) != value)
        raise ValueError(f"Lightning's Trainer refuses {given or 'trainer'}: {_one_line(error)}") from error


def loggers_of(config: DictConfig, folder: Path) -> list[Logger]:
    """The loggers that `config.logger` names, each with `folder` as its `save_dir` unless it has one.

    Raises:
        ValueError: naming the one that cannot be made, and the package that it lacks.
    """
    return _instances("logger", config.logger, save_dir=str(folder))


def shortened(config: DictConfig, arguments: Sequence[str]) -> list[str]:
    """Those of the Trainer's arguments that leave a part of the work undone: what a partial run has.

    Raises:
        ValueError: where `config.trainer` names an argument that Lightning does not know.
    """
    _check_names(config)
    return [name for name in arguments if name in config.trainer and not _whole(config.trainer[name])]


def devices_of(config: DictConfig) -> int:
    """Processes of a training, which its number of steps depends on.

    Raises:
        ValueError: where `trainer.devices` leaves it open.
    """
    devices, nodes = config.trainer.devices, config.trainer.get("num_nodes", 1)
    if isinstance(devices, bool) or not isinstance(devices, int) or devices < 1:
        raise ValueError(f"trainer.devices is {devices}; a training needs their number, which decides its steps")
    return devices * nodes


def checked_start(path: str | None, network: nn.Module) -> str | None:
    """`path` again, where it is a Lightning checkpoint of this very network.

    Raises:
        ValueError: saying what else it is.
    """
    if path is None:
        return None
    try:
        checkpoint = torch.load(path, map_location="cpu", weights_only=True)
        there = {name: tuple(tensor.shape) for name, tensor in checkpoint["state_dict"].items()}
        checkpoint["loops"], checkpoint["optimizer_states"], checkpoint["lr_schedulers"]
    except FileNotFoundError:
        raise ValueError(f"ckpt_path: there is no file {path}") from None
    except Exception as error:
        what = " ".join(str(error).split())[:120] or type(error).__name__
        raise ValueError(f"ckpt_path: {path} is not a whole checkpoint of a Lightning training ({what})") from error
    own = {name: tuple(tensor.shape) for name, tensor in network.state_dict().items()}
    differing = sorted(name for name in own.keys() | there.keys() if own.get(name) != there.get(name))
    if differing:
        raise ValueError(
            f"ckpt_path: {path} is of another network: {differing[0]} is {there.get(differing[0], 'not there')}, "
            f"expected {own.get(differing[0], 'not there')} ({len(differing)} such)"
        )
    return path


class LogScores(Callback):
    """Gives the scores of a test to every logger but TensorBoard's, which has a callback of its own.

    They are called `mAP/all`, `mAP/P0` and so on; at other tolerances than the first, `mAP/all/0.1/0.001`.
    """

    def on_test_end(self, trainer: Trainer, pl_module) -> None:
        others = [each for each in trainer.loggers if not isinstance(each, TensorBoardLogger)]
        if not others or trainer.fast_dev_run:  # type: ignore[attr-defined]  # set, but not declared
            return
        scores, labels, _ = pl_module.test_metric.evaluation()
        first = float(scores.thetas_deg[0]), float(scores.epsilons[0])
        values = {}
        for row in grouped(scores, labels):
            at = "" if (row.theta_deg, row.epsilon) == first else f"/{row.theta_deg:g}/{row.epsilon:g}"
            values[f"{row.metric}/{row.group}{at}"] = row.value
        if trainer.is_global_zero:
            for each in others:
                each.log_metrics(values)
                each.save()


def _asked(config: DictConfig) -> dict[str, Any]:
    """`config.trainer` as arguments, what has a `_target_` in it made."""
    _check_names(config)
    try:
        return dict(instantiate(config.trainer, _convert_="all"))
    except InstantiationException as error:
        raise ValueError(f"trainer: {_one_line(error.__cause__ or error)}") from error


def _check_names(config: DictConfig) -> None:
    known = [name for name in inspect.signature(Trainer.__init__).parameters if name not in ("self", *OWN_GROUPS)]
    for name in config.trainer:
        if name in OWN_GROUPS:
            raise ValueError(f"trainer.{name} is chosen with {name}=…, a group of its own")
        if name not in known:
            raise ValueError(f"trainer.{name}: Lightning's Trainer has no such argument; it has {', '.join(known)}")


def _instances(group: str, nodes: Mapping[str, Any], **given: Any) -> list:
    """What `_target_` makes under each name; `given` arguments go to those that take them and have none."""
    made = []
    for name, node in nodes.items():
        if node is None:
            continue
        if not isinstance(node, DictConfig) or "_target_" not in node:
            raise ValueError(f"{group}.{name} needs a _target_, the class to make, as module.Class")
        try:
            takes = inspect.signature(get_object(node._target_)).parameters
            made.append(instantiate(node, **{key: value for key, value in given.items() if key in takes} | dict(node)))
        except (InstantiationException, ImportError, ValueError, TypeError) as error:
            cause = error.__cause__ if isinstance(error, InstantiationException) and error.__cause__ else error
            missing = name in EXTRAS and isinstance(cause, ImportError)
            text = f"{name} is not installed; pip install 'symshrec[{name}]'" if missing else _one_line(cause)
            raise ValueError(f"{group}.{name}: {text}") from error
    return made


def _whole(value: Any) -> bool:
    return any(type(value) is type(each) and value == each for each in UNSHORTENED)


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__
