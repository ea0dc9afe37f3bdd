"""§4.1 What a method predicted, for all clouds in one file, and a store that fills it batch by batch.

Everything is float64, as in memory: at the tightest tolerance of a sweep, θ = 0.05°, 1 − cos θ is 4 · 10⁻⁷, and the
rounding of a float32 normal would shift a decision by a sixth of it. So a file scores to the bit as its planes did in
memory, for 56 bytes a plane: 3 MB for 9,000 clouds of six planes.
"""

import hashlib
import uuid
import warnings
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from safetensors import SafetensorError, safe_open

from symshrec.files.atomic import remove_temporaries, write_atomically
from symshrec.files.tensors import save
from symshrec.planes import PackedPlanes, Planes

FORMAT = "symshrec predictions 1"
WHOLE = "predictions.safetensors"
PART = "part-*.safetensors"
UNIT_ROUNDING = 1e-6  # that a normal's length may be off one
COLUMNS = {  # name: (dtype, columns; none for a vector)
    "positions": (np.int64, ()),
    "ids": (np.int64, ()),
    "starts": (np.int64, ()),
    "normals": (np.float64, (3,)),
    "points": (np.float64, (3,)),
    "confidences": (np.float64, ()),
}


class PredictionFileError(ValueError):
    """A predictions file is missing or not one of ours, or a store belongs to another run; says what to do."""


class DamagedPredictionsError(PredictionFileError):
    """A predictions file is cut short or altered; its clouds have to be predicted again."""


class Predictions(NamedTuple):
    """The predictions of C clouds, ascending by position.

    positions (C,) int64: places in the split, unique. ids (C,) int64: names on disk. planes: of the C clouds, in order.
    """

    positions: np.ndarray
    ids: np.ndarray
    planes: PackedPlanes


def save_predictions(
    path: Path,
    positions: Sequence[int] | np.ndarray,
    ids: Sequence[int] | np.ndarray,
    planes: PackedPlanes,
    metadata: Mapping[str, str],
) -> None:
    """Write one safetensors file, whole or not at all, clouds ordered by position.

    Args:
        positions, ids: (C,) whole numbers, positions unique. planes: of the C clouds.
        metadata: strings to keep with the file, such as method, configuration hash and data hash.

    Raises:
        ValueError: where the lengths differ or a position comes twice.
        DiskFullError: where there is no room.
    """
    positions, ids = np.asarray(positions, dtype=np.int64), np.asarray(ids, dtype=np.int64)
    if positions.ndim != 1 or not positions.shape == ids.shape == (len(planes),):
        raise ValueError(
            f"positions {positions.shape}, ids {ids.shape} and planes of {len(planes)} clouds do not match"
        )
    order = np.argsort(positions, kind="stable")
    positions, ids, planes = positions[order], ids[order], take_clouds(planes, order)
    if (np.diff(positions) == 0).any():
        raise ValueError(f"position {positions[np.argmin(np.diff(positions))]} comes twice; give each cloud once")
    values = {"positions": positions, "ids": ids, **{name: getattr(planes, name) for name in list(COLUMNS)[2:]}}
    tensors = {name: np.ascontiguousarray(values[name], dtype=dtype) for name, (dtype, _) in COLUMNS.items()}
    strings = {**{str(name): str(value) for name, value in metadata.items()}, "format": FORMAT}
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, save(tensors, {**strings, "sha256": _digest(tensors, strings)}))


def load_predictions(path: Path) -> Predictions:
    """Read what `save_predictions` wrote, to the bit.

    Raises:
        DamagedPredictionsError: naming the file, where it is cut short or altered.
        PredictionFileError: naming the file, where it is missing or in another format.
    """
    return _read(Path(path))[0]


def load_metadata(path: Path) -> dict[str, str]:
    """The strings kept with a file; errors as in `load_predictions`."""
    return _read(Path(path))[1]


def take_clouds(planes: PackedPlanes, clouds: np.ndarray) -> PackedPlanes:
    """The planes of some clouds, (n,) indices, packed in that order."""
    counts = planes.counts[clouds]
    starts = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    rows = np.arange(starts[-1]) + np.repeat(planes.starts[:-1][clouds] - starts[:-1], counts)
    return PackedPlanes(planes.normals[rows], planes.points[rows], planes.confidences[rows], starts)


class PredictionStore:
    """A folder that gathers the predictions of one run and survives being killed at any moment.

    Each batch is a file of its own, written whole or not at all; `consolidate` leaves one. A damaged file is named in a
    warning and removed, so that its clouds are predicted again. Several processes may append at once.

    Args:
        folder: created where missing.
        key: what the predictions depend on, such as a hash of configuration and data.
        reset: remove what the folder holds from an earlier run, whatever its key.

    Raises:
        PredictionFileError: where the folder holds another key's predictions, or a file in another format.
    """

    def __init__(self, folder: Path, key: str, reset: bool = False):
        self.folder, self.key = Path(folder), key
        self._positions: dict[Path, np.ndarray] = {}
        self.folder.mkdir(parents=True, exist_ok=True)
        if reset:
            self._remove(self._files())
        self.done()

    def append(self, positions: Sequence[int], ids: Sequence[int], planes: Sequence[Planes] | PackedPlanes):
        """Keep the predictions of some clouds, and return their file; errors as in `save_predictions`."""
        if not len(positions):
            return None
        packed = planes if isinstance(planes, PackedPlanes) else PackedPlanes.pack(planes)
        path = self.folder / PART.replace("*", f"{min(positions):08d}-{uuid.uuid4().hex[:8]}")
        save_predictions(path, positions, ids, packed, {"key": self.key})
        self._positions[path] = np.asarray(positions, dtype=np.int64)
        return path

    def done(self) -> set[int]:
        """Positions of the clouds kept so far, by any process."""
        files = self._files()
        for path in files:
            if path not in self._positions and (kept := self._kept(path)) is not None:
                self._positions[path] = kept.positions
        return {int(at) for path in files if path in self._positions for at in self._positions[path]}

    def collect(self) -> Predictions:
        """All that is kept; of a cloud that was kept twice, the one in the first file."""
        none = Predictions(np.zeros(0, np.int64), np.zeros(0, np.int64), PackedPlanes.pack([]))
        kept = [none, *(each for each in map(self._kept, self._files()) if each is not None)]
        positions, chosen = np.unique(np.concatenate([each.positions for each in kept]), return_index=True)
        ids = np.concatenate([each.ids for each in kept])[chosen]
        return Predictions(positions, ids, take_clouds(_joined([each.planes for each in kept]), chosen))

    def items(self) -> Iterator[tuple[int, Planes]]:
        """Position and planes of every cloud kept."""
        kept = self.collect()
        return ((position, kept.planes[row]) for row, position in enumerate(kept.positions.tolist()))

    def consolidate(self, metadata: Mapping[str, str] | None = None) -> Path:
        """Put everything into one file, then remove the parts; only once no process appends any more."""
        path, parts = self.folder / WHOLE, sorted(self.folder.glob(PART))
        save_predictions(path, *self.collect(), {**(metadata or {}), "key": self.key})
        self._remove(parts)
        return path

    def _remove(self, files: Sequence[Path]) -> None:
        for path in files:
            path.unlink(missing_ok=True)
        remove_temporaries(self.folder)
        self._positions.clear()

    def _files(self) -> list[Path]:
        whole = self.folder / WHOLE
        return [whole] * whole.exists() + sorted(self.folder.glob(PART))

    def _kept(self, path: Path) -> Predictions | None:
        """The predictions in one file; None, with a warning, where it was damaged and had to go."""
        try:
            predictions, metadata = _read(path)
        except DamagedPredictionsError as error:
            warnings.warn(f"{error}; removed, its clouds will be predicted again", RuntimeWarning, stacklevel=3)
            path.unlink(missing_ok=True)
            self._positions.pop(path, None)
            return None
        if metadata.get("key") != self.key:
            raise PredictionFileError(
                f"{path} belongs to another run (key {metadata.get('key')}, this run's is {self.key}); "
                f"choose another folder, or delete {self.folder}"
            )
        return predictions


def _read(path: Path) -> tuple[Predictions, dict[str, str]]:
    try:
        with safe_open(path, framework="numpy") as file:
            metadata = dict(file.metadata() or {})
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 (no mapping)
    except FileNotFoundError as error:
        raise PredictionFileError(f"{path} does not exist; give the path of a predictions file") from error
    except (SafetensorError, UnicodeDecodeError) as error:
        raise DamagedPredictionsError(f"{path} is damaged or no predictions file ({error})") from error
    checksum = metadata.pop("sha256", None)
    if checksum is None and metadata.get("format") != FORMAT:
        raise PredictionFileError(f"{path} is not in the format {FORMAT!r}; write it with save_predictions")
    if checksum not in (_digest(tensors, metadata), _digest(tensors, {})):  # once, metadata was not in it
        raise DamagedPredictionsError(f"{path} is damaged (its contents do not match its checksum)")
    if metadata.pop("format", None) != FORMAT:
        raise PredictionFileError(f"{path} is not in the format {FORMAT!r}; write it with save_predictions")
    _check(path, tensors)
    planes = PackedPlanes(*(tensors[name] for name in ("normals", "points", "confidences", "starts")))
    return Predictions(tensors["positions"], tensors["ids"], planes), metadata


def _check(path: Path, tensors: Mapping[str, np.ndarray]) -> None:
    """Hold an intact file of ours against what its writer was to guarantee."""
    if set(tensors) != set(COLUMNS):
        raise PredictionFileError(f"{path} holds {sorted(tensors)}, expected {sorted(COLUMNS)}")
    clouds, rows = tensors["positions"].size, tensors["confidences"].size
    lengths = {"positions": clouds, "ids": clouds, "starts": clouds + 1}
    for name, (dtype, columns) in COLUMNS.items():
        array, shape = tensors[name], (lengths.get(name, rows), *columns)
        if array.dtype != dtype or array.shape != shape:
            raise PredictionFileError(
                f"{path}: {name} is {array.dtype} {array.shape}, expected {dtype.__name__} {shape}"
            )
        if not np.isfinite(array).all():
            raise PredictionFileError(f"{path}: {name} holds values that are not finite; predict again")
    starts = tensors["starts"]
    if (
        starts[0] != 0
        or starts[-1] != rows
        or (np.diff(starts) < 0).any()
        or (np.diff(tensors["positions"]) <= 0).any()
    ):
        raise PredictionFileError(f"{path}: starts or positions are out of order; predict again")
    if min(tensors["positions"].min(initial=0), tensors["ids"].min(initial=0)) < 0:
        raise PredictionFileError(f"{path}: positions or ids are negative; predict again")
    if (np.abs(np.linalg.norm(tensors["normals"], axis=1) - 1) > UNIT_ROUNDING).any():
        raise PredictionFileError(f"{path}: normals are not of length one; predict again")


def _digest(tensors: Mapping[str, np.ndarray], metadata: Mapping[str, str]) -> str:
    """sha256 over the names, types, shapes and bytes of all tensors, and over the metadata."""
    digest = hashlib.sha256()
    for name in sorted(tensors):
        array = np.ascontiguousarray(tensors[name])
        digest.update(f"{name} {array.dtype.str} {array.shape} ".encode())
        digest.update(array.data)
    for name in sorted(metadata):
        digest.update(f"{name!r} {metadata[name]!r} ".encode())
    return digest.hexdigest()


def _joined(packs: Sequence[PackedPlanes]) -> PackedPlanes:
    """The clouds of several packs, one pack after the other."""
    return PackedPlanes(
        np.concatenate([each.normals for each in packs]),
        np.concatenate([each.points for each in packs]),
        np.concatenate([each.confidences for each in packs]),
        np.concatenate([[0], np.cumsum(np.concatenate([each.counts for each in packs]))]),
    )
