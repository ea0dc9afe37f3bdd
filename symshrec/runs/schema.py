"""The typed schema of conf/: a dataclass for every group, with its defaults."""

from dataclasses import asdict, dataclass, field
from typing import Any

from omegaconf import MISSING

from symshrec.data.settings import DataSettings
from symshrec.methods.optimiser import OptimiserSettings


@dataclass
class RunConfig:
    """A run of a method, a row of the tables: `name` in commands and file names, `title` in tables."""

    name: str = "${method.name}"
    title: str = "${run.name}"


@dataclass
class ToleranceConfig:
    """Angles in degrees and distances as shares of the diagonal; every pair is scored (§2.3)."""

    thetas_deg: list[float] = field(default_factory=lambda: [1.0])
    epsilons: list[float] = field(default_factory=lambda: [0.01])


@dataclass
class TrainConfig:
    """How a learned method is trained (`symshrec train`).

    epochs: over the training folds. batch_size: clouds a step, on each device. steps_per_round: what validation and
    the length of a training are counted in. checkpoint_minutes: a killed run loses no more, nor more than its round.
    validate_every: rounds. init: weights to start from. rotate: turn every cloud anew each
    time it comes, uniformly over SO(3). precision: Lightning's, or `auto`, which takes bfloat16 where the processor is
    made for it. cooldown: so many epochs branch off from the last checkpoint of a training with a constant learning
    rate and bring that to zero, in a folder of their own; the training can go on afterwards. max_minutes: stop after
    the step in which they pass; the same command goes on.
    """

    epochs: float = 1.0
    batch_size: int = 32
    steps_per_round: int = 500
    checkpoint_minutes: float = 10.0
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
    """Arguments of lightning.Trainer; any other of its is added with a plus, as in +trainer.fast_dev_run=true."""

    accelerator: str = "cpu"
    devices: int = 1
    strategy: str = "auto"
    precision: str = "32-true"
    sync_batchnorm: bool = False
    enable_progress_bar: bool = True


@dataclass
class PathsConfig:
    """Folders, relative to where a command is run."""

    data: str = "data"
    runs: str = "runs"
    results: str = "results"
    tables: str = "${paths.runs}/${data.name}${data.variant}/tables"


@dataclass
class TensorBoardConfig:
    """What a test leaves for TensorBoard; `clouds` are drawn with their true and predicted planes."""

    clouds: int = 4


@dataclass
class RowsConfig:
    """The rows of the tables, by the names of their runs; the one list of them, from which sweeps are made too.

    published: the paper's, in its order. ours: further ones. refined: those that come again with refinement. cards:
    further runs whose results are kept for the model cards. so3, so3_refined: of table_so3, on clouds under full
    rotations. all: whether `symshrec reproduce` runs the refined ones and the oracle's too.
    """

    published: list[str] = field(default_factory=list)
    ours: list[str] = field(default_factory=list)
    refined: list[str] = field(default_factory=list)
    so3: list[str] = field(default_factory=list)
    so3_refined: list[str] = field(default_factory=list)
    cards: list[str] = field(default_factory=list)
    all: bool = False
    by_metrics: bool = False


@dataclass
class Config:
    """The whole configuration, conf/config.yaml.

    logger, callbacks: what `_target_` makes under each name. ckpt_path: a Lightning checkpoint that a training starts
    from. part: K/N, the part of the shards that this one of N calls of `generate` makes, or all. changed: what the
    command line changed beyond what `folder` says already, as the folder's last part.
    """

    data: DataSettings = field(default_factory=lambda: DataSettings(root="${paths.data}/${data.name}${data.variant}"))
    method: Any = MISSING
    run: RunConfig = field(default_factory=RunConfig)
    tolerance: ToleranceConfig = field(default_factory=ToleranceConfig)
    trainer: dict[str, Any] = field(default_factory=lambda: asdict(TrainerConfig()))
    logger: dict[str, Any] = field(default_factory=dict)
    callbacks: dict[str, Any] = field(default_factory=dict)
    ckpt_path: str | None = None
    train: TrainConfig = field(default_factory=TrainConfig)
    paths: PathsConfig = field(default_factory=PathsConfig)
    tensorboard: TensorBoardConfig = field(default_factory=TensorBoardConfig)
    seed: int = 2023
    workers: int = 2
    part: str = "all"
    name: str = "${run.name}${when:${method.refine},_refine}"
    title: str = "${run.title}${when:${method.refine},' + refine'}"
    folder: str = MISSING
    changed: str = "${hydra:job.override_dirname}"
    rows: RowsConfig = field(default_factory=RowsConfig)
