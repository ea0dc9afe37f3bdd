"""What a folder of shards says about itself: the request it was begun with, and the manifest written last."""

import hashlib
import json
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path

from symshrec.files.atomic import ShardError

GENERATOR_VERSION = 2  # raised whenever the same config, or the defaults, would give other bytes
MANIFEST = "manifest.json"
REQUEST = "request.json"
HASHING_THREADS = 4


@dataclass(frozen=True)
class ShardRecord:
    """One shard: its file, the clouds first … first + clouds − 1 of its split, and what it holds."""

    file: str
    split: str
    first: int
    clouds: int
    points: int
    max_planes: int
    families: dict[str, int]
    solids: dict[str, int]
    perturbations: dict[str, int]
    bytes: int
    sha256: str


@dataclass(frozen=True)
class SplitSummary:
    """Counts over a split: clouds, points, planes of the cloud with most, clouds by family, solid, perturbation."""

    clouds: int
    points: int
    max_planes: int
    families: dict[str, int]
    solids: dict[str, int]
    perturbations: dict[str, int]


@dataclass(frozen=True)
class Manifest:
    """A finished folder: how it was made and the sha256 of every shard. Equal configs give equal manifests."""

    generator_version: int
    seed: int
    config: dict
    max_planes: int
    splits: dict[str, SplitSummary]
    shards: list[ShardRecord]

    @classmethod
    def summarise(cls, config: dict, shards: list[ShardRecord]) -> "Manifest":
        """The manifest of these shards, in this order, made from this plain config."""
        splits = {}
        for split in dict.fromkeys(each.split for each in shards):
            own = [each for each in shards if each.split == split]
            splits[split] = SplitSummary(
                clouds=sum(each.clouds for each in own),
                points=sum(each.points for each in own),
                max_planes=max(each.max_planes for each in own),
                families=_total(each.families for each in own),
                solids=_total(each.solids for each in own),
                perturbations=_total(each.perturbations for each in own),
            )
        most = max(each.max_planes for each in shards)
        return cls(GENERATOR_VERSION, config["seed"], config, most, splits, list(shards))

    def to_json(self) -> str:
        """The manifest file's text."""
        return json_text(asdict(self))

    @property
    def hash(self) -> str:
        """sha256 of the manifest file: one name for the data, to stand beside every result."""
        return hashlib.sha256(self.to_json().encode()).hexdigest()


def json_text(value) -> str:
    """`value` as JSON with sorted keys, the same text for the same value."""
    return json.dumps(value, indent=1, sort_keys=True) + "\n"


def read_manifest(root: str | Path) -> Manifest:
    """The manifest of a finished folder of shards.

    Raises:
        ShardError: where it is missing (generation unfinished), unreadable, or of another version.
    """
    path = Path(root) / MANIFEST
    try:
        content = json.loads(path.read_text())
    except FileNotFoundError:
        state = "generation is unfinished" if (path.parent / REQUEST).exists() else "there are no shards here"
        raise ShardError(f"{path} is missing: {state}; run symshrec generate for this folder") from None
    except (OSError, ValueError) as error:
        raise ShardError(f"{path} is not readable ({error}); delete it and generate again") from error
    try:
        if content["generator_version"] != GENERATOR_VERSION:
            raise ShardError(
                f"{path} was written by generator version {content['generator_version']}, this is version "
                f"{GENERATOR_VERSION}; generate into another folder"
            )
        content["splits"] = {name: SplitSummary(**each) for name, each in content["splits"].items()}
        content["shards"] = [ShardRecord(**each) for each in content["shards"]]
        return Manifest(**content)
    except (KeyError, TypeError, AttributeError) as error:
        raise ShardError(f"{path} is no manifest of shards ({error}); delete it and generate again") from error


def damage(root: Path, record: ShardRecord, contents: bool = True) -> str | None:
    """What is wrong with a shard's file, or None: missing, another size, or (with `contents`) another sha256."""
    path = root / record.file
    if not path.is_file():
        return "is missing"
    if path.stat().st_size != record.bytes:
        return f"has {path.stat().st_size} bytes instead of {record.bytes} (truncated or replaced)"
    if contents:
        with open(path, "rb") as file:
            if hashlib.file_digest(file, "sha256").hexdigest() != record.sha256:
                return "has other contents than the manifest's sha256 (altered)"
    return None


def damages(root: Path, records: list[ShardRecord], contents: bool = True) -> list[str | None]:
    """`damage` of every shard, in order, hashed side by side."""
    with ThreadPoolExecutor(HASHING_THREADS) as threads:
        return list(threads.map(lambda record: damage(root, record, contents), records))


def _total(counts) -> dict[str, int]:
    total = Counter()
    for each in counts:
        total.update(each)
    return dict(total)
