"""What decides the weights of a training, and whether a folder holds one that was decided otherwise."""

import hashlib
import json
from collections.abc import Iterator
from pathlib import Path

from omegaconf import DictConfig, OmegaConf

SETTINGS = "settings.json"  # in the training's folder
NO_INFLUENCE = (  # beginnings of keys
    "data.batch_size",
    "data.hard",
    "data.in_memory",
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
    "train.checkpoint_minutes",
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


def training_identity(config: DictConfig) -> dict[str, object]:
    """All that decides the weights, by dotted key; plain values."""
    nodes = {name: config[name] for name in ("data", "method", "train", "trainer")}
    plain = {name: OmegaConf.to_container(node, resolve=True, enum_to_str=True) for name, node in nodes.items()}
    flat = dict(_flattened(plain | {"seed": config.seed}))
    if config.ckpt_path is not None and Path(config.ckpt_path).is_file():
        flat["ckpt_path"] = hashlib.sha256(Path(config.ckpt_path).read_bytes()).hexdigest()
    if not flat.get("data.stream"):
        flat.pop("data.stream", None)  # older trainings, which go on, know of none
    return {key: value for key, value in flat.items() if not key.startswith(NO_INFLUENCE)}


def _flattened(node: object, prefix: str = "") -> Iterator[tuple[str, object]]:
    if not isinstance(node, dict):
        yield prefix.removesuffix("."), node
        return
    for key, value in node.items():
        yield from _flattened(value, f"{prefix}{key}.")


def refuse_other_settings(folder: Path, settings: dict[str, object]) -> None:
    """Raises ValueError where the folder holds a training by other settings."""
    there = read_json(folder / SETTINGS)
    if there is None or there == settings:
        return
    differing = sorted(key for key in there.keys() | settings.keys() if there.get(key) != settings.get(key))
    raise ValueError(
        f"{folder} holds a training with other settings ({', '.join(differing)}); name another train.folder, or remove "
        "that one"
    )


def read_json(path: Path) -> dict | None:
    """What a JSON file holds; None where there is none, or none that can be read."""
    try:
        return json.loads(path.read_text())
    except (OSError, ValueError):
        return None
