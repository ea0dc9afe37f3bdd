"""One run: a method over a test split, its predictions kept as they come, its metrics written last."""

import hashlib
import json
import logging
import re
import time
from collections.abc import MutableMapping, Sequence
from pathlib import Path

from lightning import Callback, Trainer, seed_everything
from omegaconf import DictConfig, OmegaConf

from symshrec.data.batch import Batch
from symshrec.data.datamodule import SymmetryDataModule
from symshrec.data.settings import SamplingKind
from symshrec.files.atomic import write_atomically
from symshrec.files.predictions import PredictionStore
from symshrec.methods.base import SymmetryMethod
from symshrec.methods.fit import REFINEMENT_VERSION
from symshrec.metrics import Scores, grouped
from symshrec.planes import Planes
from symshrec.runs.config import method_of, settings_of
from symshrec.runs.folders import claimed, refuse_other_data
from symshrec.runs.identity import digest, run_identity, unrefined
from symshrec.runs.provenance import code_version, hardware, peak_memory_mib
from symshrec.runs.stores import find_store, lacking, open_store
from symshrec.runs.trainer import TEST_SHORTENED, LogScores, shortened, trainer_of

log = logging.getLogger(__name__)
METRICS = "metrics.json"  # written last
TIMES = "seconds.txt"  # beside the predictions: clouds and seconds of every batch


def datamodule_of(config: DictConfig) -> SymmetryDataModule:
    """The datamodule that `config.data` describes."""
    order = (config.train.batch_size, config.train.steps_per_round)
    return SymmetryDataModule(settings_of(config.data), config.seed, *order)


def evaluate(
    config: DictConfig,
    method: SymmetryMethod | None = None,
    callbacks: Sequence[Callback] = (),
    shelf: MutableMapping | None = None,
) -> dict:
    """Detect, score and record: predictions.safetensors, config.yaml and, last, metrics.json in `config.folder`.

    A killed run goes on where it was. A finished one is left alone where nothing changed, only scored again where the
    tolerances did, and completed where its predictions are gone or damaged. Predictions of other settings in the folder
    are kept aside, see `open_store`. A partial run (`trainer.fast_dev_run`, `limit_test_batches`) uses and leaves none
    of these.

    Args:
        method: ready for use, and described by `config.method`; made from that where it is None.
        callbacks: for Lightning's Trainer, beside those that `config.callbacks` names.
        shelf: of the method, shared with runs of the same method over the same clouds (see `SymmetryMethod`).

    Returns:
        What metrics.json holds; of a partial run the same scores, with the arguments that shortened it as `partial`.

    Raises:
        FolderInUseError: where another process works in this folder. ValueError: where it holds another data's results,
            or for what the configuration cannot mean.
    """
    if config.ckpt_path is not None:
        raise ValueError("ckpt_path is for train; evaluate takes weights: method.weights=[FILE.safetensors]")
    folder = Path(config.folder)
    with claimed(folder):
        return _evaluated(config, folder, method, callbacks, shelf)


def clouds_left(config: DictConfig, data: SymmetryDataModule) -> int:
    """How many clouds the run that `config` describes has still to detect on; 0 where it has ended and is whole.

    Args:
        data: as `datamodule_of` makes it, for rows over the same clouds to share.

    Raises:
        ValueError: for what the configuration cannot mean.
    """
    folder, method = Path(config.folder), method_of(config)
    identity = identity_of(config, data, method)
    key, clouds = digest(identity), len(data.positions(data.test_split))
    if _finished(folder, _request(config, method, identity)) and not lacking(folder, key, clouds):
        return 0
    place = find_store(folder, key)
    return max(clouds - len(PredictionStore(place, key).done()), 1) if place else clouds


def _evaluated(
    config: DictConfig,
    folder: Path,
    method: SymmetryMethod | None,
    callbacks: Sequence[Callback],
    shelf: MutableMapping | None,
) -> dict:
    """`evaluate` in a folder that no other process writes in."""
    seed_everything(config.seed, workers=True, verbose=False)
    data, method = datamodule_of(config), method_of(config) if method is None else method
    if why := shortened(config, TEST_SHORTENED):
        return _partial(config, folder / "partial", data, method, why)
    refuse_other_data(folder, config, data.split(data.test_split).fingerprint)
    identity = identity_of(config, data, method)
    key, request = digest(identity), _request(config, method, identity)
    clouds = len(data.positions(data.test_split))
    if finished := _finished(folder, request):
        if not (lack := lacking(folder, key, clouds)):
            log.info("%s: up to date in %s", config.title, folder)
            return finished
        log.warning("%s: %s; predicting what is missing", config.title, lack)
    store = open_store(folder, identity)
    method.known, method.detected = dict(store.items()), _unrefined(config, method, identity)
    method.shelf = shelf
    method.measure_at(list(config.tolerance.thetas_deg), list(config.tolerance.epsilons))
    keeper = StorePredictions(store)
    trainer = _trainer(config, folder, keeper, *callbacks)
    (folder / METRICS).unlink(missing_ok=True)  # not before the trainer is known to be a valid one
    trainer.test(method, datamodule=data, verbose=False)
    about = {"request_sha256": request, "key": key, "identity": identity}
    return _record(config, folder, data, method, store, keeper, about)


def identity_of(config: DictConfig, data: SymmetryDataModule, method: SymmetryMethod) -> dict:
    """What decides the predictions of the run that `config` describes."""
    split, drawn = data.test_split, data.settings.sampling
    points = {} if drawn.kind is SamplingKind.none else {"points": drawn.points}
    return run_identity(
        method,
        data=data.split(split).fingerprint,
        positions=data.positions(split),
        sampling={"kind": drawn.kind.name, **points},
        seed=config.seed,
        precision=str(config.trainer.precision),
        refinement=REFINEMENT_VERSION,
    )


def _request(config: DictConfig, method: SymmetryMethod, identity: dict) -> str:
    """sha256 over all that decides metrics.json: the predictions, and how they are scored and named."""
    tolerance = OmegaConf.to_container(config.tolerance, resolve=True)
    scoring = {"title": config.title, "tolerance": tolerance, "count_threshold": method.count_threshold}
    return digest({"predictions": identity, **scoring})


def _finished(folder: Path, request: str) -> dict | None:
    """What metrics.json holds where it answers this request over all clouds."""
    try:
        found = json.loads((folder / METRICS).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    known = isinstance(found, dict) and found.get("request_sha256") == request and not found.get("partial")
    return found if known else None


class StorePredictions(Callback):
    """Keeps every batch's new predictions on disk as they come, and the seconds they took in all sessions of a run."""

    def __init__(self, store: PredictionStore):
        self.store, self.times = store, store.folder / TIMES
        self._started = 0.0

    def on_test_batch_start(self, trainer, method, batch, batch_idx, dataloader_idx=0) -> None:
        self._started = time.perf_counter()

    def on_test_batch_end(self, trainer, method, outputs: list[Planes], batch: Batch, batch_idx, dataloader_idx=0):
        new = [row for row, position in enumerate(batch.positions) if position not in method.known]
        if new:
            self.store.append(
                [batch.positions[row] for row in new], [batch.ids[row] for row in new], [outputs[row] for row in new]
            )
            with open(self.times, "a", encoding="ascii") as file:
                file.write(f"{len(new)} {time.perf_counter() - self._started:.3f}\n")

    def total(self) -> dict[str, int | float]:
        """Clouds detected and wall-clock seconds spent on them, a cloud twice where a kill came between."""
        return seconds_in(self.times)


def seconds_in(times: Path) -> dict[str, int | float]:
    """What a run's TIMES add up to, zeros where there are none."""
    lines = times.read_text(encoding="ascii", errors="replace") if times.exists() else ""
    pairs = re.findall(r"^(\d+) (\d+\.\d+)$", lines, re.ASCII | re.MULTILINE)  # a kill may have torn one
    return {
        "detected_clouds": sum(int(clouds) for clouds, _ in pairs),
        "wall": round(sum(float(seconds) for _, seconds in pairs), 3),
    }


def _partial(config: DictConfig, folder: Path, data: SymmetryDataModule, method: SymmetryMethod, why: list) -> dict:
    """Detect and score what a shortened test comes to, and store none of it; loggers alone write into `folder`."""
    method.measure_at(list(config.tolerance.thetas_deg), list(config.tolerance.epsilons))
    _trainer(config, folder).test(method, datamodule=data, verbose=False)
    assert method.test_metric is not None  # since `measure_at`
    scores, labels, _ = method.test_metric.evaluation()
    return {
        "name": config.title,
        "method": config.method.name,
        "run": config.run.name,
        "partial": why,
        "scores": [row._asdict() for row in grouped(scores, labels)],
        "data": {"name": f"{config.data.name}{config.data.variant}", "split": data.test_split, "clouds": len(scores)},
    }


def _unrefined(config: DictConfig, method: SymmetryMethod, identity: dict) -> dict[int, Planes]:
    """Of a run with refinement, the planes that the same run without it has left; none where there is no such run."""
    if not method.refine:
        return {}
    plain = config.copy()
    plain.method.refine = False
    key = digest(unrefined(identity))
    place = find_store(Path(plain.folder), key)
    return dict(PredictionStore(place, key).items()) if place else {}


def _trainer(config: DictConfig, folder: Path, *callbacks: Callback) -> Trainer:
    quiet = {"max_epochs": 1, "enable_checkpointing": False, "enable_model_summary": False}
    return trainer_of(config, folder, [*callbacks, LogScores()], **quiet)


def _record(config, folder: Path, data, method, store: PredictionStore, keeper: StorePredictions, about: dict) -> dict:
    split = data.split(data.test_split)
    store.consolidate({"method": config.title, "data": split.fingerprint, "count_threshold": method.count_threshold})
    scores, labels, _ = method.test_metric.evaluation()
    resolved = OmegaConf.to_yaml(config, resolve=True)
    write_atomically(folder / "config.yaml", resolved.encode())
    result = {
        "name": config.title,
        "method": config.method.name,
        "run": config.run.name,
        "oracle": method.oracle,
        "partial": len(scores) < len(data.positions(data.test_split)),
        "scores": [row._asdict() for row in grouped(scores, labels)],
        "precision_recall": _curves(scores),
        "data": {
            "name": f"{config.data.name}{config.data.variant}",
            "split": data.test_split,
            "clouds": len(scores),
            "clouds_in_split": len(split),
            "manifest_sha256": split.fingerprint,
        },
        "seed": config.seed,
        "weights": getattr(method, "weights_record", None),
        "hardware": hardware(),
        "seconds": keeper.total(),
        "peak_memory_mib": peak_memory_mib(),
        "config_sha256": hashlib.sha256(resolved.encode()).hexdigest(),
        "code": code_version(),
        **about,
    }
    write_atomically(folder / METRICS, (json.dumps(result, indent=1) + "\n").encode())
    return result


def _curves(scores: Scores) -> list[dict]:
    """The 11-bin precision-recall curve of the whole set at every tolerance pair."""
    return [
        {"theta_deg": float(theta), "epsilon": float(epsilon), "precision": scores.mean_curve(row, column).tolist()}
        for row, theta in enumerate(scores.thetas_deg)
        for column, epsilon in enumerate(scores.epsilons)
    ]
