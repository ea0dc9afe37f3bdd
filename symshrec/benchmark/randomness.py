"""§2.1 The random streams of (seed, split, *key): NumPy's own, of one key or of many at once."""

import hashlib
from collections.abc import Iterator

import numpy as np
from numpy.random.bit_generator import ISeedSequence

# Of NumPy's SeedSequence: it mixes words of 32 bits into a pool of 4, and takes words of any number out of the pool.
WORDS = 4
TO_POOL, TO_STATE = (0x43B0D7E5, 0x931E8875), (0x8B51F9DD, 0x58F38DED)  # the first constant, and each next one's factor
OF_POOL, OF_WORD = np.uint32(0xCA01F9DD), np.uint32(0x4973F715)
HALF = np.uint32(16)


def generator(seed: int, split: str, *key: int) -> np.random.Generator:
    """The random stream of (seed, split, *key), independent of every other and of any order of drawing."""
    return np.random.Generator(np.random.PCG64(_sequence(seed, split, *key)))


def generators(seed: int, split: str, keys: np.ndarray) -> Iterator[np.random.Generator]:
    """`generator(seed, split, *key)` for every row of keys (G, K), below 2³²: for many rows much faster.

    What SeedSequence does once for each is done here for all at once.
    """
    pool = np.tile(_sequence(seed, split).pool, (len(keys), 1))
    words_of_seed = max(WORDS, -(-seed.bit_length() // 32))
    used = WORDS * (words_of_seed + 1)  # constants: for each word of the seed, and for the split's
    for column in keys.T.astype(np.uint32):
        hashed = _hashed(column[:, None], _constants(*TO_POOL, used, WORDS))
        pool = _folded(OF_POOL * pool - OF_WORD * hashed)
        used += WORDS
    states = _hashed(np.tile(pool, 2), _constants(*TO_STATE, 0, 2 * WORDS)).view(np.uint64)
    return (np.random.Generator(np.random.PCG64(_Seed(state))) for state in states)  # type: ignore[arg-type]


def _sequence(seed: int, split: str, *key: int) -> np.random.SeedSequence:
    split_number = int.from_bytes(hashlib.sha256(split.encode()).digest()[:4], "little")
    return np.random.SeedSequence(seed, spawn_key=(split_number, *key))


def _constants(first: int, factor: int, start: int, count: int) -> np.ndarray:
    """From the `start`-th one on, each with the next one: (2, count)."""
    powers = [first * pow(factor, start + place, 2**32) % 2**32 for place in range(count + 1)]
    return np.array([powers[:-1], powers[1:]], dtype=np.uint32)


def _hashed(words: np.ndarray, constants: np.ndarray) -> np.ndarray:
    before, after = constants
    return _folded((words ^ before) * after)


def _folded(words: np.ndarray) -> np.ndarray:
    return words ^ (words >> HALF)


class _Seed(ISeedSequence):
    """A state (4,) uint64 that is there already."""

    def __init__(self, state: np.ndarray):
        self.state = state

    def generate_state(self, n_words, dtype=np.uint32):
        return self.state
