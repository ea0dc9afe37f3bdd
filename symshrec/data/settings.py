"""How clouds are loaded, as typed values that the schema and the datamodule share. No torch here: it loads slowly."""

from enum import Enum


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
