"""Where clouds come from and how they are loaded, as typed values: the schema of conf/data and the datamodule's
only description. No torch here: it loads slowly."""

from dataclasses import dataclass, field
from enum import Enum

from symshrec.benchmark.config import BenchmarkConfig


class DataKind(Enum):
    """What lies under data.root: our shards, the text files of the track or its successor, or clouds without truth."""

    shards = "shards"
    official = "official"
    clouds = "clouds"


class SamplingKind(Enum):
    """How points are chosen: not at all, farthest point sampling (M1's step 1), or uniformly at random."""

    none = "none"
    farthest = "farthest"
    random = "random"


@dataclass(frozen=True)
class SamplingSettings:
    """Points drawn once a cloud and cached beside the data; by the run's seed where chance draws them."""

    kind: SamplingKind = SamplingKind.none
    points: int = 1024


@dataclass(frozen=True)
class DataSettings:
    """Where clouds come from, which of them count, and how they are loaded.

    Args:
        name, variant: what the data are called in results; the variant names what differs from the defaults.
        kind: what `root` holds.
        root: folder of shards, or of `benchmark-train/` and `benchmark-test/` (or one such folder itself).
        batch_size, workers: of the loaders.
        fold, folds: which part of the training split validates; folds are balanced over families and perturbations.
        families, perturbations, solids: keep only clouds with these labels; None keeps all.
        limit: keep only the first so many clouds of each split; None keeps all.
        subset: keep only clouds whose ID stands in this text file, one a line (official folders).
        verify: compare every shard with its sha256 before use.
        test_split: what test and predict read; `train` for studies that must leave the test split alone.
        stream: train on clouds that are made as they are needed and never come again, `workers` processes making them;
            nothing of the training split need be on disk.
        in_memory: whether the training clouds' sampled points are held in memory, or mapped from a file beside the
            data; None holds them where they fill less than a quarter of the machine's memory.
        validation_clouds: the first so many of the validating fold, which the split has in no order; None takes all.
        hard: the data whose P6–P9 stand beside this one's tables. scan: and whose P10–P15.
        sampling: see `SamplingSettings`.
        benchmark: how shards are made, where they are.

    Raises:
        ValueError: for a fold that there is not, or a stream of what nothing generates.
    """

    name: str = "clouds"
    variant: str = ""
    kind: DataKind = DataKind.shards
    root: str = "data"
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
    stream: bool = False
    in_memory: bool | None = None
    test_split: str = "test"
    validation_clouds: int | None = 1000
    hard: str = "hard_quick"
    scan: str = "scan_quick"
    sampling: SamplingSettings = field(default_factory=SamplingSettings)
    benchmark: BenchmarkConfig = field(default_factory=BenchmarkConfig)

    def __post_init__(self):
        if not 0 <= self.fold < self.folds:
            raise ValueError(
                f"data.fold is {self.fold}; with {self.folds} folds it must be between 0 and {self.folds - 1}"
            )
        if self.stream and self.kind is not DataKind.shards:
            raise ValueError(
                f"data.stream=true needs data that are generated, and data.kind={self.kind.name} is not; choose "
                "data=paper, say"
            )
        if self.stream and self.solids is not None:
            raise ValueError("data.solids is known only of clouds that are made; leave it out with data.stream=true")
