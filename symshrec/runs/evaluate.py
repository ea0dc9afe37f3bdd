"""One run: a method over a test split, its predictions kept as they come, its metrics written last."""

import hashlib
import json
import logging
import time
from pathlib import Path

from lightning import Callback, Trainer, seed_everything
from omegaconf import DictConfig, OmegaConf

from symshrec.data.batch import Batch
from symshrec.data.datamodule import SymmetryDataModule
from symshrec.files.atomic import write_atomically
from symshrec.files.predictions import PredictionFileError, PredictionStore
from symshrec.methods.base import SymmetryMethod
from symshrec.methods.learned import LearnedMethod
from symshrec.metrics import Scores, grouped
from symshrec.planes import Planes
from symshrec.runs.config import method_of
from symshrec.runs.provenance import code_version, hardware, peak_memory_mib, source_files
from symshrec.runs.trainer import TEST_SHORTENED, LogScores, shortened, trainer_of

log = logging.getLogger(__name__)
TIMES = "seconds.txt"  # beside the predictions: clouds and seconds of every batch
NO_INFLUENCE = ("name", "workers", "weights")  # of a method's configuration, on what it predicts


def datamodule_of(config: DictConfig) -> SymmetryDataModule:
    """The datamodule that `config.data` describes."""
    data = config.data
    lists = {name: None if data[name] is None else list(data[name]) for name in ("families", "perturbations", "solids")}
    names = ("root", "kind", "batch_size", "workers", "fold", "folds", "limit", "subset", "verify", "test_split")
    return SymmetryDataModule(
        **{name: data[name] for name in names},
        **lists,
        sampling=data.sampling.kind,
        points=data.sampling.points,
        seed=config.seed,
        train_batch_size=config.train.batch_size,
        steps_per_round=config.train.steps_per_round,
        validation_clouds=data.validation_clouds,
    )


def evaluate(config: DictConfig, method: SymmetryMethod | None = None) -> dict:
    """Detect, score and record: predictions.safetensors, config.yaml and, last, metrics.json in `config.folder`.

    A killed run goes on where it was; a finished one is only scored again where the tolerances changed, and left alone
    where nothing did. A partial one (`trainer.fast_dev_run`, `limit_test_batches`) uses and leaves none of these.

    Args:
        method: ready for use, and described by `config.method`; made from that where it is None.

    Returns:
        What metrics.json holds; of a partial run the same scores, with the arguments that shortened it as `partial`.

    Raises:
        ValueError: for what the configuration cannot mean.
    """
    if config.ckpt_path is not None:
        raise ValueError("ckpt_path is for train; evaluate takes weights: method.weights=[FILE.safetensors]")
    folder = Path(config.folder)
    seed_everything(config.seed, workers=True, verbose=False)
    data, method = datamodule_of(config), method_of(config) if method is None else method
    if why := shortened(config, TEST_SHORTENED):
        return _partial(config, folder / "partial", data, method, why)
    key = prediction_key(config, data, method)
    request = hashlib.sha256(f"{key} {config.title} {config.tolerance}".encode()).hexdigest()
    finished = _read(folder / "metrics.json")
    if finished and finished["request_sha256"] == request:
        log.info("%s: up to date in %s", config.title, folder)
        return finished
    store = _store(folder / "predictions", key)
    method.known, method.detected = dict(store.items()), _unrefined(config, data, method)
    method.measure_at(list(config.tolerance.thetas_deg), list(config.tolerance.epsilons))
    keeper = StorePredictions(store)
    trainer = _trainer(config, folder, keeper)
    (folder / "metrics.json").unlink(missing_ok=True)
    trainer.test(method, datamodule=data, verbose=False)
    return _record(config, folder, data, method, store, keeper, {"request_sha256": request, "key": key})


def prediction_key(config: DictConfig, data: SymmetryDataModule, method: SymmetryMethod) -> str:
    """sha256 over all that decides the predictions: the method's configuration and code, the clouds, the seed.

    Refinement counts only where it is on, so that without it a run's predictions outlive changes of its code. What all
    methods share to run at all (`FRAME`) does not count.
    """
    settings = OmegaConf.to_container(config.method, resolve=True, enum_to_str=True)
    code = source_files(type(method).__module__)
    if settings["refine"]:
        code |= source_files("symshrec.methods.fit")
    else:
        del settings["refine"]
    facts = {
        "method": {name: value for name, value in settings.items() if name not in NO_INFLUENCE},
        **({"weights": [each["sha256"] for each in record]} if (record := weights_record(method)) else {}),
        "code": [hashlib.sha256(path.read_bytes()).hexdigest() for path in sorted(code)],
        "data": data.split(data.test_split).fingerprint,
        "positions": hashlib.sha256(data.positions(data.test_split).tobytes()).hexdigest(),
        "sampling": [config.data.sampling.kind.name, config.data.sampling.points],
        "seed": config.seed,
    }
    return hashlib.sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()


def weights_record(method: SymmetryMethod) -> list[dict[str, str]] | None:
    """Names and hashes of a method's weights; None for one that has none."""
    return method.weights_record if isinstance(method, LearnedMethod) else None


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
        lines = self.times.read_text(encoding="ascii").splitlines() if self.times.exists() else []
        pairs = [line.split() for line in lines if len(line.split()) == 2]
        return {
            "detected_clouds": sum(int(clouds) for clouds, _ in pairs),
            "wall": round(sum(float(seconds) for _, seconds in pairs), 3),
        }


def _partial(config: DictConfig, folder: Path, data: SymmetryDataModule, method: SymmetryMethod, why: list) -> dict:
    """Detect and score what a shortened test comes to, and store none of it; loggers alone write into `folder`."""
    method.measure_at(list(config.tolerance.thetas_deg), list(config.tolerance.epsilons))
    _trainer(config, folder).test(method, datamodule=data, verbose=False)
    scores, labels, _ = method.test_metric.evaluation()
    return {
        "name": config.title,
        "method": config.method.name,
        "run": config.run.name,
        "partial": why,
        "scores": [row._asdict() for row in grouped(scores, labels)],
        "data": {"name": f"{config.data.name}{config.data.variant}", "split": data.test_split, "clouds": len(scores)},
    }


def _unrefined(config: DictConfig, data: SymmetryDataModule, method: SymmetryMethod) -> dict[int, Planes]:
    """Of a run with refinement, the planes that the same run without it has left; none where there is no such run."""
    plain = config.copy()
    plain.method.refine = False
    folder = Path(plain.folder) / "predictions"
    if not config.method.refine or plain.folder == config.folder or not folder.is_dir():
        return {}
    try:
        return dict(PredictionStore(folder, prediction_key(plain, data, method)).items())
    except PredictionFileError:
        return {}


def _store(folder: Path, key: str) -> PredictionStore:
    """The store of these very predictions; what an older code or other data left there is of no use and goes."""
    try:
        return PredictionStore(folder, key)
    except PredictionFileError:
        log.warning("%s holds predictions of other code, data or settings; starting anew", folder)
        (folder / TIMES).unlink(missing_ok=True)
        return PredictionStore(folder, key, reset=True)


def _trainer(config: DictConfig, folder: Path, *callbacks: Callback) -> Trainer:
    quiet = {"max_epochs": 1, "enable_checkpointing": False, "enable_model_summary": False}
    return trainer_of(config, folder, [*callbacks, LogScores()], **quiet)


def _record(config, folder: Path, data, method, store: PredictionStore, keeper: StorePredictions, keys: dict) -> dict:
    split = data.split(data.test_split)
    about = {"method": config.title, "data": split.fingerprint, "count_threshold": method.count_threshold}
    store.consolidate(about)
    scores, labels, _ = method.test_metric.evaluation()
    resolved = OmegaConf.to_yaml(config, resolve=True)
    write_atomically(folder / "config.yaml", resolved.encode())
    result = {
        "name": config.title,
        "method": config.method.name,
        "run": config.run.name,
        "oracle": method.oracle,
        "scores": [row._asdict() for row in grouped(scores, labels)],
        "precision_recall": _curves(scores),
        "data": {
            "name": f"{config.data.name}{config.data.variant}",
            "split": data.test_split,
            "clouds": len(scores),
            "manifest_sha256": split.fingerprint,
        },
        "seed": config.seed,
        "weights": weights_record(method),
        "hardware": hardware(),
        "seconds": keeper.total(),
        "peak_memory_mib": peak_memory_mib(),
        "config_sha256": hashlib.sha256(resolved.encode()).hexdigest(),
        "code": code_version(),
        **keys,
    }
    write_atomically(folder / "metrics.json", (json.dumps(result, indent=1) + "\n").encode())
    return result


def _curves(scores: Scores) -> list[dict]:
    """The 11-bin precision-recall curve of the whole set at every tolerance pair."""
    return [
        {"theta_deg": float(theta), "epsilon": float(epsilon), "precision": scores.mean_curve(row, column).tolist()}
        for row, theta in enumerate(scores.thetas_deg)
        for column, epsilon in enumerate(scores.epsilons)
    ]


def _read(path: Path) -> dict | None:
    """A metrics.json, None where there is none that is whole."""
    try:
        return json.loads(path.read_text())
    except (OSError, ValueError):
        return None
