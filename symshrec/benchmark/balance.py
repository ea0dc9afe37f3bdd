"""§2.1–2.2 Which family and perturbation each cloud of a split has: random order, exact counts."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from symshrec.benchmark.cloud import ALL_FAMILIES, FAMILIES, PERTURBATIONS, PUBLISHED_PERTURBATIONS
from symshrec.benchmark.config import BenchmarkConfig
from symshrec.benchmark.randomness import generator


@dataclass(frozen=True, eq=False)
class SplitLabels:
    """families and perturbations (C,) uint8: per cloud, the place in ALL_FAMILIES and in PERTURBATIONS."""

    families: np.ndarray
    perturbations: np.ndarray

    def __len__(self) -> int:
        return len(self.families)


def split_labels(config: BenchmarkConfig, split: str) -> SplitLabels:
    """Labels of a split's clouds in their order, from (seed, split) and the configured counts alone.

    Both counts hold exactly, and every family has its perturbations in the proportion of the whole split, to one or two
    clouds: 42 clouds hold each of the 42 pairs once. P6–P15 and planeless shapes occur only where a split's counts name
    them.

    Raises:
        ValueError: for a split the config lacks, or counts that do not add up, naming the field.
    """
    if split not in config.splits:
        raise ValueError(f"the config has no split {split!r}; it has {', '.join(config.splits) or 'none'}")
    sizes = config.splits[split]
    families = _counts(f"splits.{split}.families", sizes.families, ALL_FAMILIES, sizes.clouds, len(FAMILIES))
    name, even = f"splits.{split}.perturbations", len(PUBLISHED_PERTURBATIONS)
    perturbations = _counts(name, sizes.perturbations, PERTURBATIONS, sizes.clouds, even)
    return _labels(config.seed, split, families, perturbations)


def _counts(name: str, given: dict[str, int] | None, names: Sequence[str], clouds: int, even: int) -> tuple[int, ...]:
    """Clouds per name: as given, or spread evenly over the first `even` names with the remainder on the first ones."""
    if clouds < 1:
        raise ValueError(f"{name.rpartition('.')[0]}.clouds is {clouds}; a split holds 1 cloud or more")
    if given is None:
        return tuple(clouds // even + (place < clouds % even) for place in range(even))
    unknown = [each for each in given if each not in names]
    if unknown:
        raise ValueError(f"{name} names {', '.join(unknown)}; there are {', '.join(names)}")
    counts = tuple(int(given.get(each, 0)) for each in names)
    if min(counts) < 0 or sum(counts) != clouds:
        raise ValueError(
            f"{name} is {dict(given)}, together {sum(counts)}; it must add up to the split's {clouds} clouds"
        )
    return counts


@lru_cache(maxsize=16)
def _labels(seed: int, split: str, families: tuple[int, ...], perturbations: tuple[int, ...]) -> SplitLabels:
    """Families in blocks, perturbations interleaved in proportion, the pairs shuffled together."""
    shuffle = generator(seed, split).permutation(sum(families))
    blocks = np.repeat(np.arange(len(families), dtype=np.uint8), families)
    turns = np.concatenate([(np.arange(count) + 0.5) / max(count, 1) for count in perturbations])
    names = np.repeat(np.arange(len(perturbations), dtype=np.uint8), perturbations)
    interleaved = names[np.argsort(turns, kind="stable")]
    labels = SplitLabels(blocks[shuffle], interleaved[shuffle])
    labels.families.setflags(write=False)
    labels.perturbations.setflags(write=False)
    return labels
