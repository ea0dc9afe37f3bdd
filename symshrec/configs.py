"""Typed schema of conf/, and the entry point that names what may be written where a key or a value is wrong."""

import functools
import os
import re
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import Any

import hydra
from hydra import compose, initialize_config_dir
from hydra.core.config_store import ConfigStore
from hydra.core.global_hydra import GlobalHydra
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.errors import HydraException
from omegaconf import MISSING, DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from symshrec.benchmark.config import BenchmarkConfig
from symshrec.loading import DataKind, SamplingKind
from symshrec.methods.m1 import settings as m1
from symshrec.methods.m2 import settings as m2
from symshrec.methods.optimiser import OptimiserSettings


@dataclass
class SamplingConfig:
    """Points drawn once a cloud and cached beside the data."""

    kind: SamplingKind = SamplingKind.none
    points: int = 1024


@dataclass
class DataConfig:
    """Where clouds come from (conf/data), which of them count, and how they are loaded."""

    name: str = MISSING
    variant: str = ""
    kind: DataKind = DataKind.shards
    root: str = "${paths.data}/${data.name}${data.variant}"
    batch_size: int = 32
    workers: int = 0
    fold: int = 0
    folds: int = 5
    families: list[str] | None = None
    perturbations: list[str] | None = None
    solids: list[str] | None = None
    limit: int | None = None
    subset: str | None = None
    verify: bool = True
    test_split: str = "test"
    validation_clouds: int | None = 1000
    hard: str = "hard_quick"  # the data whose P6–P9 stand beside this one's tables
    sampling: SamplingConfig = field(default_factory=SamplingConfig)
    benchmark: BenchmarkConfig = field(default_factory=BenchmarkConfig)


@dataclass
class RunConfig:
    """A run of a method: `name` in file names, `title` in tables (the paper's, where it is one of the paper's)."""

    name: str = MISSING
    title: str = MISSING


@dataclass
class MethodConfig:
    """What every method's configuration has. refine: fit its planes to the points afterwards, whatever the method."""

    _target_: str = MISSING
    name: str = MISSING
    workers: int = 1
    count_threshold: float = 0.5
    refine: bool = False


@dataclass
class LearnedConfig(MethodConfig):
    """A method with weights: names of shipped ones, or .safetensors files; several answer together."""

    weights: list[str] = field(default_factory=list)


@dataclass
class M1Config(LearnedConfig):
    """§3.1; see symshrec.methods.m1.settings."""

    _target_: str = "symshrec.methods.m1.module.M1"
    name: str = "m1"
    network: m1.NetworkSettings = field(default_factory=m1.NetworkSettings)
    loss: m1.LossSettings = field(default_factory=m1.LossSettings)
    decode: m1.DecodeSettings = field(default_factory=m1.DecodeSettings)
    twice: bool = False


@dataclass
class M2Config(LearnedConfig):
    """§3.2; see symshrec.methods.m2.settings. run=pretrain trains what another class makes of the same."""

    _target_: str = "symshrec.methods.m2.module.M2"
    name: str = "m2"
    network: m2.NetworkSettings = field(default_factory=m2.NetworkSettings)
    loss: m2.LossSettings = field(default_factory=m2.LossSettings)
    cleaning: m2.CleaningSettings = field(default_factory=m2.CleaningSettings)
    confidence: m2.Confidence = m2.Confidence.none
    pretrain: m2.PretrainSettings = field(default_factory=m2.PretrainSettings)


@dataclass
class M3Config(MethodConfig):
    """§3.3; see symshrec.methods.m3.detection.M3Settings."""

    _target_: str = "symshrec.methods.m3.module.M3"
    name: str = "m3"
    neighbours: int = 200
    eigenpairs: int = 10
    mollify: float = 1e-3
    laplacian_neighbours: int = 30
    time_factor: float = 0.3
    chamfer_limit: float = 100.0
    separation_deg: float = 5.0
    count_threshold: float = 0.95


@dataclass
class M4Config(MethodConfig):
    """Our training-free detector; see symshrec.methods.m4.detection.M4Settings."""

    _target_: str = "symshrec.methods.m4.module.M4"
    name: str = "m4"
    points: int = 8192
    neighbours: int = 12
    directions: int = 1500
    candidates: int = 28
    separation_deg: float = 5.0
    max_planes: int = 40
    together: bool = True
    rounds: int = 10
    calibration: list[float] = field(default_factory=lambda: [1.759, -82.546, -60.19, 236.37])


@dataclass
class TruthConfig(MethodConfig):
    """The oracle; see symshrec.methods.truth.Truth."""

    _target_: str = "symshrec.methods.truth.Truth"
    name: str = "truth"
    angle_deg: float = 0.3
    offset: float = 0.003
    refine: bool = True


@dataclass
class ToleranceConfig:
    """Angles in degrees and distances as shares of the diagonal; every pair is scored (§2.3)."""

    thetas_deg: list[float] = field(default_factory=lambda: [1.0])
    epsilons: list[float] = field(default_factory=lambda: [0.01])


@dataclass
class TrainConfig:
    """How a learned method is trained (experiments/train.py).

    epochs: over the training folds. batch_size: clouds a step, on each device. steps_per_round: between checkpoints;
    a killed run loses no more. validate_every: rounds. init: weights to start from. rotate: turn every cloud anew each
    time it comes, uniformly over SO(3). max_minutes: stop after the round in which they pass; the same command goes on.
    """

    epochs: float = 1.0
    batch_size: int = 32
    steps_per_round: int = 500
    validate_every: int = 5
    optimiser: OptimiserSettings = field(default_factory=OptimiserSettings)
    precision: str = "bf16-mixed"
    compile: bool = False
    rotate: bool = False
    init: str | None = None
    max_minutes: float | None = None
    clouds_shown: int = 4
    folder: str = "${paths.runs}/${data.name}${data.variant}/training/${name}${when:${data.fold},_fold${data.fold}}"


@dataclass
class TrainerConfig:
    """Arguments of lightning.Trainer."""

    accelerator: str = "cpu"
    devices: int = 1
    strategy: str = "auto"
    precision: str = "32-true"
    sync_batchnorm: bool = False
    max_epochs: int = 1
    enable_progress_bar: bool = True


@dataclass
class PathsConfig:
    """Folders, relative to where a command is run."""

    data: str = "data"
    runs: str = "runs"
    results: str = "results"


@dataclass
class TensorBoardConfig:
    """What a test leaves for TensorBoard; `clouds` are drawn with their true and predicted planes."""

    enabled: bool = True
    clouds: int = 4


@dataclass
class Config:
    """The whole configuration, conf/config.yaml."""

    data: DataConfig = field(default_factory=DataConfig)
    method: Any = MISSING
    run: RunConfig = field(default_factory=RunConfig)
    tolerance: ToleranceConfig = field(default_factory=ToleranceConfig)
    trainer: TrainerConfig = field(default_factory=TrainerConfig)
    train: TrainConfig = field(default_factory=TrainConfig)
    paths: PathsConfig = field(default_factory=PathsConfig)
    tensorboard: TensorBoardConfig = field(default_factory=TensorBoardConfig)
    seed: int = 2023
    workers: int = 2
    name: str = "${method.name}_${run.name}${when:${method.refine},_refine}"
    title: str = "${run.title}${when:${method.refine},' + refine'}"
    folder: str = MISSING
    tables: list[str] = field(default_factory=list)


METHODS = {"m1": M1Config, "m2": M2Config, "m3": M3Config, "m4": M4Config, "truth": TruthConfig}


def conf_folder() -> Path:
    """conf/ of this checkout, or its copy inside an installed wheel."""
    packaged = Path(str(files("symshrec"))) / "conf"
    return packaged if packaged.is_dir() else Path(str(files("symshrec"))).parent / "conf"


def register() -> None:
    """Make the schema known to Hydra, and `${when:condition,text}`: the text where the condition holds, or nothing."""
    OmegaConf.register_new_resolver("when", lambda condition, text: text if condition else "", replace=True)
    store = ConfigStore.instance()
    store.store(name="schema", node=Config)
    for name, node in METHODS.items():
        store.store(group="method", name=f"{name}_schema", node=node)


def load(overrides: list[str] | None = None) -> DictConfig:
    """The configuration that these command-line overrides give.

    Raises:
        ValueError: for an unknown key or a value of the wrong kind, naming it and the valid ones.
    """
    register()
    try:
        if GlobalHydra.instance().is_initialized():
            return compose("config", overrides=overrides or [])
        with initialize_config_dir(str(conf_folder()), version_base="1.3"):
            return compose("config", overrides=overrides or [])
    except (HydraException, OmegaConfBaseException) as error:
        raise ValueError(_explain(error)) from error


def benchmark_of(config: DictConfig) -> BenchmarkConfig:
    """The benchmark that `config.data` describes, as plain dataclasses."""
    return OmegaConf.to_object(config.data.benchmark)


def _explain(error: Exception) -> str:
    text = f"{error}\n{error.__cause__ or ''}"
    unknown = re.search(r"Key '(\w+)' (?:is )?not in '?(?:struct|\w+)'?\s+full_key: (\S+)", text)
    if not unknown:
        return "\n".join(line for line in text.splitlines() if line.strip() and "full stack trace" not in line)
    key = unknown[2]
    whole = load()
    node = OmegaConf.select(whole, key.rpartition(".")[0]) if "." in key else whole
    valid = {str(each) for each in node} if isinstance(node, DictConfig) else set()
    if "." not in key:
        valid |= {folder.name for folder in conf_folder().iterdir() if folder.is_dir()}
    return f"unknown key '{key}'; valid here: {', '.join(sorted(valid)) or 'none'}"


def _check(arguments: list[str]) -> None:
    """Compose every single alternative of every override once, so that a sweep fails before its first job."""
    words = [word for word in arguments if not word.startswith("-") and "=" in word]
    with initialize_config_dir(str(conf_folder()), version_base="1.3"):
        loader = GlobalHydra.instance().config_loader()
        parsed = [
            each for each in OverridesParser.create(loader).parse_overrides(words) if not each.is_hydra_override()
        ]
        fixed = [each.input_line for each in parsed if not each.is_sweep_override()]
        choices = [
            [f"{each.get_key_element()}={value}" for value in each.sweep_string_iterator()]
            for each in parsed
            if each.is_sweep_override()
        ]
        if not all(choices):
            raise ValueError(f"a sweep in {' '.join(words)} matches nothing in {conf_folder()}")
        load([*fixed, *(alternatives[0] for alternatives in choices)])
        for number, alternatives in enumerate(choices):
            others = [each[0] for position, each in enumerate(choices) if position != number]
            for alternative in alternatives[1:]:
                load([*fixed, *others, alternative])


def entry(task: Callable[[DictConfig], None]) -> Callable[[], None]:
    """Make `task` a Hydra command over conf/config.yaml whose user errors are one line and exit status 2."""

    @functools.wraps(task)
    def guarded(config: DictConfig) -> None:
        with _one_line_errors():
            task(config)

    def command() -> None:
        register()
        if not any(word in ("--help", "-h", "--hydra-help", "--info", "-i") for word in sys.argv[1:]):
            with _one_line_errors():
                _check(sys.argv[1:])
        hydra.main(version_base="1.3", config_path=str(conf_folder()), config_name="config")(guarded)()

    return command


class _one_line_errors:
    """Turns a user's mistake (ValueError, OSError) into its message and exit status 2."""

    def __enter__(self) -> None:
        return None

    def __exit__(self, kind, error, traceback) -> None:
        if isinstance(error, ValueError | OSError) and not os.environ.get("HYDRA_FULL_ERROR"):
            print(f"error: {error}", file=sys.stderr)
            raise SystemExit(2) from None
