"""What a folder of shards says about itself: the request it was begun with, and the manifest written last."""

import hashlib
import json
import re
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path

from symshrec.files.foreign import is_plain_name, is_whole, parse_json

GENERATOR_VERSION = 2  # raised whenever the same config, or the defaults, would give other bytes
MANIFEST = "manifest.json"
REQUEST = "request.json"
HASHING_THREADS = 4
SHARD_SUFFIX = ".safetensors"
COUNTED = ("families", "solids", "perturbations")


class ShardError(ValueError):
    """A shard, or the folder of shards, is missing, damaged or another's; says which and how to mend it."""


@dataclass(frozen=True)
class ShardRecord:
    """One shard: its file, the clouds first … first + clouds − 1 of its split, and what it holds.

    Raises:
        ValueError: naming the field that no shard can have; `file` and `split` are single names, never paths.
    """

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

    def __post_init__(self):
        if not is_plain_name(self.file) or not self.file.endswith(SHARD_SUFFIX):
            raise ValueError(f"file is {self.file!r}; it must be the name of a {SHARD_SUFFIX} file, without a folder")
        _check_split(self.split)
        _check_counts(self)
        if not is_whole(self.first):
            raise ValueError(f"first is {self.first!r}; it must be a whole number from 0 on")
        if not is_whole(self.bytes, 1):
            raise ValueError(f"bytes is {self.bytes!r}; it must be a whole number from 1 on")
        if not isinstance(self.sha256, str) or not re.fullmatch("[0-9a-f]{64}", self.sha256):
            raise ValueError(f"sha256 is {self.sha256!r}; it must be 64 hexadecimal digits")


@dataclass(frozen=True)
class SplitSummary:
    """Counts over a split: clouds, points, planes of the cloud with most, clouds by family, solid, perturbation.

    Raises:
        ValueError: naming the count that cannot be.
    """

    clouds: int
    points: int
    max_planes: int
    families: dict[str, int]
    solids: dict[str, int]
    perturbations: dict[str, int]

    def __post_init__(self):
        _check_counts(self)


@dataclass(frozen=True)
class Manifest:
    """A finished folder: how it was made and the sha256 of every shard. Equal configs give equal manifests.

    Raises:
        ValueError: where a file comes twice, a split's shards do not follow each other from cloud 0 on, or the counts
            of splits and shards do not agree.
    """

    generator_version: int
    seed: int
    config: dict
    max_planes: int
    splits: dict[str, SplitSummary]
    shards: list[ShardRecord]

    def __post_init__(self):
        if not is_whole(self.seed) or not isinstance(self.config, dict) or self.config.get("seed") != self.seed:
            raise ValueError(f"seed is {self.seed!r} and config {str(self.config)[:40]!r}; they do not belong together")
        twice = [file for file, count in Counter(each.file for each in self.shards).items() if count > 1]
        if twice:
            raise ValueError(f"shard {twice[0]} is listed twice")
        following = Counter()
        for shard in self.shards:
            if shard.first != following[shard.split]:
                raise ValueError(f"shard {shard.file} begins at cloud {shard.first}, not {following[shard.split]}")
            following[shard.split] += shard.clouds
        counted = _split_counts(self.shards)
        for split in self.splits.keys() | counted.keys():
            _check_split(split)
            if self.splits.get(split) != counted.get(split):
                raise ValueError(f"the counts of split {split!r} are not those of its shards")
        if self.max_planes != max((each.max_planes for each in self.shards), default=None):
            raise ValueError(f"max_planes is {self.max_planes!r}, which is not that of the shards")

    @classmethod
    def summarise(cls, config: dict, shards: list[ShardRecord]) -> "Manifest":
        """The manifest of these shards, in this order, made from this plain config."""
        most = max(each.max_planes for each in shards)
        return cls(GENERATOR_VERSION, config["seed"], config, most, _split_counts(shards), list(shards))

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
        content = parse_json(path.read_bytes())
    except FileNotFoundError:
        state = "there are no shards here; run symshrec generate for this folder"
        if (path.parent / REQUEST).exists():
            state = (
                "generation is unfinished; run symshrec generate for this folder again (where parts of it were made, "
                "without part): it makes what is missing and writes the manifest"
            )
        raise ShardError(f"{path} is missing: {state}") from None
    except (OSError, ValueError) as error:
        raise ShardError(f"{path} is not readable ({error}); delete it and generate again") from error
    try:
        if content["generator_version"] != GENERATOR_VERSION:
            raise ShardError(
                f"{path} was written by generator version {content['generator_version']!r}, this is version "
                f"{GENERATOR_VERSION}; generate into another folder"
            )
        splits = {name: SplitSummary(**each) for name, each in content.pop("splits").items()}
        shards = [_record(place, each) for place, each in enumerate(content.pop("shards"))]
        return Manifest(**content, splits=splits, shards=shards)
    except ShardError:
        raise
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        raise ShardError(f"{path} is no manifest of shards ({error}); delete it and generate again") from error


def read_request(root: Path) -> dict:
    """The request that a folder was begun with: `generator_version` and the plain `config`.

    Raises:
        ShardError: where it is missing or not readable.
    """
    path = Path(root) / REQUEST
    try:
        request = parse_json(path.read_bytes())
        if not isinstance(request, dict) or not isinstance(request.get("config"), dict):
            raise ValueError("it lacks the configuration")
        return {"generator_version": request.get("generator_version"), "config": request["config"]}
    except (OSError, ValueError) as error:
        raise ShardError(f"{path} is not readable ({error}); empty the folder and start again") from error


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


def _record(place: int, fields: dict) -> ShardRecord:
    try:
        return ShardRecord(**fields)
    except (TypeError, ValueError) as error:
        raise ValueError(f"shards[{place}]: {error}") from error


def _split_counts(shards: list[ShardRecord]) -> dict[str, SplitSummary]:
    """The summary of every split that shards make up, in their order."""
    splits = {}
    for split in dict.fromkeys(each.split for each in shards):
        own = [each for each in shards if each.split == split]
        splits[split] = SplitSummary(
            clouds=sum(each.clouds for each in own),
            points=sum(each.points for each in own),
            max_planes=max(each.max_planes for each in own),
            **{name: _total(getattr(each, name) for each in own) for name in COUNTED},
        )
    return splits


def _total(counts) -> dict[str, int]:
    total = Counter()
    for each in counts:
        total.update(each)
    return dict(total)


def _check_split(split) -> None:
    if not is_plain_name(split) or not split.isidentifier():
        raise ValueError(f"split is {split!r}; a split's name consists of letters, digits and underscores")


def _check_counts(counts: ShardRecord | SplitSummary) -> None:
    for name, least in (("clouds", 1), ("points", 1), ("max_planes", 0)):
        if not is_whole(getattr(counts, name), least):
            raise ValueError(f"{name} is {getattr(counts, name)!r}; it must be a whole number from {least} on")
    for name in COUNTED:
        groups = getattr(counts, name)
        whole = isinstance(groups, dict) and all(map(is_whole, groups.values()))
        if not whole or sum(groups.values()) != counts.clouds:
            raise ValueError(f"{name} is {str(groups)[:60]}; it must count each of the {counts.clouds} clouds once")
