"""Trained weights as safetensors: half precision, with the network they belong to and how they were trained."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

import torch
from safetensors import SafetensorError, safe_open
from torch import Tensor

from symshrec.files.atomic import write_atomically
from symshrec.files.foreign import is_whole, parse_json
from symshrec.files.tensors import save

FORMAT = "symshrec weights 1"
LONGEST_REASON = 200  # characters of another library's error
LONGEST_TRAINING = 1e12  # seconds or epochs


class WeightsError(ValueError):
    """A weights file that is missing, of another method, or not one of ours."""


@dataclass(frozen=True, eq=False)
class Weights:
    """Trained weights.

    name: of the shipped file, or its path. network, detection: the method's settings that belong to them, by name.
    training: how they came about.
    """

    name: str
    method: str
    sha256: str
    network: dict
    training: dict
    tensors: dict[str, Tensor]
    detection: dict

    @property
    def about(self) -> str:
        """One phrase on the network and its training."""
        training = self.training
        if not training.get("seconds"):
            return f"{self.network.get('points')} points"
        machine = training["hardware"]["gpu"] or training["hardware"]["cpu"]
        return (
            f"{self.network['points']} points, {training['epochs']:.3g} epochs of {training['data']['name']} "
            f"(fold {training['fold']}), {training['seconds'] / 60:.0f} min on {machine}"
        )


def shipped(method: str = "") -> list[str]:
    """Names of the weights that come with the package, those of one method where one is named."""
    return sorted(path.stem for path in weights_folder().glob(f"{method}*.safetensors"))


def read_weights(name: str, *methods: str) -> Weights:
    """The shipped weights of this name, or those in the file at this path; of any method where none is named.

    Raises:
        WeightsError: naming the file and what can be done.
    """
    path = Path(name) if name.endswith(".safetensors") else weights_folder() / f"{name}.safetensors"
    if not path.is_file():
        method = methods[0] if methods else ""
        there = f"{f'of {method} ' if method else ''}there are {', '.join(shipped(method)) or 'none'}"
        raise WeightsError(f"no weights called {name!r} come with symshrec; {there}; or give a .safetensors file")
    try:
        with safe_open(path, framework="pt") as file:
            about = file.metadata() or {}
            tensors = {key: file.get_tensor(key) for key in file.keys()}  # noqa: SIM118, a file is no dict
    except (SafetensorError, UnicodeDecodeError, OSError) as error:
        raise WeightsError(f"{path} is not a readable safetensors file ({_one_line(error)})") from error
    if about.get("format") != FORMAT:
        raise WeightsError(f"{path} was not written by symshrec train; its metadata lack format {FORMAT!r}")
    method, network, training = (
        about.get("method", ""),
        _record(about, "network", path),
        _record(about, "training", path),
    )
    if methods and method not in methods:
        raise WeightsError(f"{path} holds weights of {method[:40]}, not of {' or '.join(dict.fromkeys(methods))}")
    if not is_whole(network.get("points"), 1):
        raise WeightsError(f"{path}: network.points is {str(network.get('points'))[:40]}; it must be a whole number")
    for key, value in tensors.items():
        if not value.isfinite().all():
            raise WeightsError(f"{path}: {key[:80]!r} holds values that are not finite; train again or fetch it again")
    sha256 = hashlib.sha256(path.read_bytes()).hexdigest()
    tensors = {key: value.float() if value.is_floating_point() else value for key, value in tensors.items()}
    detection = _record(about, "detection", path) if "detection" in about else {}
    weights = Weights(name, method, sha256, network, training, tensors, detection)
    _check_training(training, path)
    return weights


def _record(about: Mapping[str, str], field: str, path: Path) -> dict:
    """One of the records in JSON among a file's metadata."""
    try:
        record = parse_json(about.get(field, ""))
    except ValueError as error:
        raise WeightsError(f"{path}: its {field} is no JSON ({_one_line(error)}); fetch it again") from error
    if not isinstance(record, dict):
        raise WeightsError(f"{path}: its {field} is {str(record)[:40]}; it must be a record of values by name")
    return record


def _check_training(training: dict, path: Path) -> None:
    """Hold what is said of the training against what `Weights.about` takes from it."""
    if training.get("seconds") == 0 or "seconds" not in training:
        return
    hardware, data = training.get("hardware"), training.get("data")
    for name in ("seconds", "epochs"):
        value = training.get(name)
        if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value < LONGEST_TRAINING:
            raise WeightsError(f"{path}: training.{name} is {str(value)[:40]}; it must be a number from 0 on")
    if not is_whole(training.get("fold")):
        raise WeightsError(f"{path}: training.fold is {str(training.get('fold'))[:40]}; it must be a whole number")
    machine = isinstance(hardware, dict) and (hardware.get("gpu") or hardware.get("cpu"))
    if not isinstance(machine, str):
        raise WeightsError(f"{path}: training.hardware names no cpu or gpu")
    if not isinstance(data, dict) or not isinstance(data.get("name"), str):
        raise WeightsError(f"{path}: training.data has no name")


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())[:LONGEST_REASON]


def write_weights(
    path: Path,
    method: str,
    network: Mapping,
    training: Mapping,
    tensors: Mapping[str, Tensor],
    exact: Sequence = (),
    detection: Mapping | None = None,
) -> None:
    """Matrices in half precision, vectors (biases, norms, statistics) in single; in place at once or not at all.

    Args:
        path: a .safetensors file.
        method, network, training, detection: see `Weights`; plain values.
        tensors: of the network.
        exact: names of matrices to keep in single precision.

    Raises:
        DiskFullError: where there is no room.
    """
    stored = {}
    for key, value in tensors.items():
        value = value.detach().cpu().contiguous()
        stored[key] = value.half() if value.is_floating_point() and value.ndim > 1 and key not in exact else value
    about = {"format": FORMAT, "method": method, "network": json.dumps(network), "training": json.dumps(training)}
    about |= {"detection": json.dumps(detection)} if detection else {}
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, save({key: value.numpy() for key, value in stored.items()}, about))


def load_into(network: torch.nn.Module, weights: Weights) -> None:
    """Give a network its weights.

    Raises:
        WeightsError: naming what is missing, left over or of another shape.
    """
    check_fit(network, weights)
    network.load_state_dict(weights.tensors)


def check_fit(network: torch.nn.Module, weights: Weights) -> None:
    """Hold weights against a network, which may be on torch's meta device and so take no memory.

    Raises:
        WeightsError: naming what is missing, left over or of another shape or kind.
    """
    expected, problems = network.state_dict(), []
    for key in (*expected, *(key for key in weights.tensors if key not in expected)):
        ours, theirs = expected.get(key), weights.tensors.get(key)
        if theirs is None or ours is None:
            problems.append(f"{key[:80]} is {'missing' if theirs is None else 'left over'}")
        elif theirs.shape != ours.shape or theirs.is_floating_point() != ours.is_floating_point():
            found = f"{theirs.dtype} {tuple(theirs.shape)}"
            problems.append(f"{key[:80]} is {found} instead of {ours.dtype} {tuple(ours.shape)}")
    if problems:
        more = f" and {len(problems) - 3} more" * (len(problems) > 3)
        raise WeightsError(f"weights {weights.name!r} do not fit the network: {'; '.join(problems[:3])}{more}")


def weights_folder() -> Path:
    """Where the shipped weights lie."""
    return Path(str(files("symshrec.methods.weights")))
