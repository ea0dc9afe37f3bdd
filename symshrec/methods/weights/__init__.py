"""Trained weights as safetensors: half precision, with the network they belong to and how they were trained."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor

FORMAT = "symshrec weights 1"


class WeightsError(ValueError):
    """A weights file that is missing, of another method, or not one of ours."""


@dataclass(frozen=True, eq=False)
class Weights:
    """name: of the shipped file, or its path; network: settings by name; training: how they came about."""

    name: str
    method: str
    sha256: str
    network: dict
    training: dict
    tensors: dict[str, Tensor]

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
    except SafetensorError as error:
        raise WeightsError(f"{path} is not a readable safetensors file ({error})") from error
    if about.get("format") != FORMAT:
        raise WeightsError(f"{path} was not written by symshrec train; its metadata lack format {FORMAT!r}")
    if methods and about["method"] not in methods:
        raise WeightsError(f"{path} holds weights of {about['method']}, not of {' or '.join(dict.fromkeys(methods))}")
    sha256 = hashlib.sha256(path.read_bytes()).hexdigest()
    tensors = {key: value.float() if value.is_floating_point() else value for key, value in tensors.items()}
    return Weights(name, about["method"], sha256, json.loads(about["network"]), json.loads(about["training"]), tensors)


def write_weights(
    path: Path, method: str, network: Mapping, training: Mapping, tensors: Mapping[str, Tensor], exact: Sequence = ()
) -> None:
    """Matrices in half precision, vectors (biases, norms, statistics) in single; in place at once or not at all.

    Args:
        path: a .safetensors file.
        method, network, training: see `Weights`; plain values.
        tensors: of the network.
        exact: names of matrices to keep in single precision.
    """
    stored = {}
    for key, value in tensors.items():
        value = value.detach().cpu().contiguous()
        stored[key] = value.half() if value.is_floating_point() and value.ndim > 1 and key not in exact else value
    about = {"format": FORMAT, "method": method, "network": json.dumps(network), "training": json.dumps(training)}
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_suffix(".partial")
    save_file(stored, partial, metadata=about)
    partial.chmod(0o644)  # safetensors makes it readable to its owner alone
    partial.replace(path)


def load_into(network: torch.nn.Module, weights: Weights) -> None:
    """Give a network its weights.

    Raises:
        WeightsError: naming what is missing, left over or of another shape.
    """
    try:
        network.load_state_dict(weights.tensors)
    except RuntimeError as error:
        raise WeightsError(f"weights {weights.name!r} do not fit the network: {error}") from error


def weights_folder() -> Path:
    """Where the shipped weights lie."""
    return Path(str(files("symshrec.methods.weights")))
