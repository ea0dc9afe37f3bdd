"""The typed schema of conf/: a dataclass for every group, with its defaults."""

from dataclasses import dataclass, field
from typing import Any

from omegaconf import MISSING

from symshrec.benchmark.config import BenchmarkConfig
from symshrec.data.settings import DataKind, SamplingKind
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
    scan: str = "scan_quick"  # and whose P10–P15
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
    """§3.3; see symshrec.methods.m3.pipeline.M3Settings."""

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
    """Our training-free detector; see symshrec.methods.m4.pipeline.M4Settings."""

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
class PcaIcpConfig(MethodConfig):
    """A baseline; see symshrec.methods.baselines.pca_icp.PcaIcpSettings."""

    _target_: str = "symshrec.methods.baselines.module.PcaIcp"
    name: str = "pca_icp"
    points: int = 8192
    probes: int = 1000
    rounds: int = 50
    kept: float = 0.9
    within: float = 2.0
    separation_deg: float = 5.0
    count_threshold: float = 0.75


@dataclass
class RansacConfig(MethodConfig):
    """A baseline; see symshrec.methods.baselines.ransac.RansacSettings."""

    _target_: str = "symshrec.methods.baselines.module.Ransac"
    name: str = "ransac"
    points: int = 8192
    probes: int = 500
    rounds: int = 30
    kept: float = 0.9
    within: float = 2.0
    separation_deg: float = 5.0
    pairs: int = 2000
    first_probes: int = 32
    starts: int = 100
    coarse: float = 0.1
    max_planes: int = 16
    seed: int = 0
    count_threshold: float = 0.75


@dataclass
class TruthConfig(MethodConfig):
    """The oracle; see symshrec.methods.oracle.Truth."""

    _target_: str = "symshrec.methods.oracle.Truth"
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
    time it comes, uniformly over SO(3). precision: Lightning's, or `auto`, which takes bfloat16 where the processor is
    made for it. cooldown: so many epochs branch off from the last checkpoint of a training with a constant learning
    rate and bring that to zero, in a folder of their own; the training can go on afterwards. max_minutes: stop after
    the round in which they pass; the same command goes on.
    """

    epochs: float = 1.0
    batch_size: int = 32
    steps_per_round: int = 500
    validate_every: int = 5
    optimiser: OptimiserSettings = field(default_factory=OptimiserSettings)
    precision: str = "auto"
    compile: bool = False
    rotate: bool = False
    init: str | None = None
    cooldown: float | None = None
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
    tables_so3: list[str] = field(default_factory=list)
    cards: list[str] = field(default_factory=list)


METHODS = {
    "m1": M1Config,
    "m2": M2Config,
    "m3": M3Config,
    "m4": M4Config,
    "pca_icp": PcaIcpConfig,
    "ransac": RansacConfig,
    "truth": TruthConfig,
}
