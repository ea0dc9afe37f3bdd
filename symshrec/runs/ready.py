"""A run of a method object that somebody made: its description, in the place of one in conf/method."""

import hashlib
import re
import uuid
from dataclasses import asdict, is_dataclass
from enum import Enum
from typing import Any

import torch
from omegaconf import DictConfig, OmegaConf, open_dict

from symshrec.methods.base import SymmetryMethod


def described(config: DictConfig, method: SymmetryMethod, named: bool = False) -> DictConfig:
    """A copy of `config` whose `method` says all that is known of a ready one, so that its runs can be told apart.

    Known are the dataclass `method.settings`, else what Lightning calls its hyperparameters, and the bytes of its
    network. Where there are neither settings nor hyperparameters, no stored predictions are taken for its own.

    Args:
        named: whether `config` has a name and a title for the run already; otherwise it is called as the class.
    """
    settings = getattr(method, "settings", None)
    known = _plain(asdict(settings)) if is_dataclass(settings) else _plain(dict(method.hparams))
    kind = type(method)
    name = getattr(method, "name", None) or re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", kind.__name__).lower()
    node = {
        **known,
        "_target_": f"{kind.__module__}.{kind.__qualname__}",
        "name": name,
        "workers": method.pool.workers,
        "count_threshold": method.count_threshold,
        "refine": method.refine,
        "network": _network_hash(method),
    }
    if not known:
        node["object"] = uuid.uuid4().hex
    config = config.copy()
    with open_dict(config):
        config.method = OmegaConf.create(node)
    if not named:
        config.name, config.title = f"{name}_refine" if method.refine else name, kind.__name__
    return config


def _network_hash(method: SymmetryMethod) -> str | None:
    """sha256 of the method's parameters and buffers; None where it has none."""
    state = method.state_dict()
    if not state:
        return None
    found = hashlib.sha256()
    for name, tensor in sorted(state.items()):
        found.update(f"{name} {tensor.dtype} {tuple(tensor.shape)}".encode())
        found.update(tensor.detach().cpu().contiguous().flatten().view(torch.uint8).numpy().tobytes())
    return found.hexdigest()


def _plain(value: Any) -> Any:
    """What YAML can hold: enums by name, tuples as lists, anything else that it has no word for as its text."""
    if isinstance(value, Enum):
        return value.name
    if isinstance(value, dict):
        return {str(key): _plain(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    return value if isinstance(value, str | int | float | bool | None) else str(value)
