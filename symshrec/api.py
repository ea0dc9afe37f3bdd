"""The package from Python: `symshrec.detect`, the mirror planes of anyone's points in their own coordinates, and
`symshrec.evaluate` and `symshrec.train`, the commands of these names."""

import functools
import json
from contextlib import nullcontext
from dataclasses import dataclass
from os import PathLike, fspath
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import torch
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException
from torch import Tensor

from symshrec.files.processes import forked
from symshrec.files.threads import one_thread
from symshrec.geometry.straight import blocks, is_straight
from symshrec.methods import DEFAULT
from symshrec.methods.detector import Detector, made
from symshrec.methods.fit import refined
from symshrec.methods.registry import check_method_name
from symshrec.planes import Planes, PointGroup, point_group
from symshrec.runs.config import as_overrides, load, settings_of

if TYPE_CHECKING:
    from symshrec.methods.base import SymmetryMethod  # Lightning

MOST_POINTS = 100_000  # that a method is given, unless told


class TensorPlanes(NamedTuple):
    """What `Planes` holds, as tensors: normals (K, 3) of length one, points (K, 3) and confidences (K,)."""

    normals: Tensor
    points: Tensor
    confidences: Tensor

    def group(self, diagonal: float | None = None, angle_deg: float = 1.0, distance: float = 0.01) -> PointGroup:
        """The point group that the planes make, in NumPy arrays; see `Planes.group`."""
        normals, points = (each.detach().cpu().double().numpy() for each in (self.normals, self.points))
        return point_group(normals, points, diagonal, angle_deg, distance)


def detect(
    points: np.ndarray | Tensor,
    method: str | Detector = DEFAULT,
    *,
    min_confidence: float | None = None,
    max_planes: int | None = None,
    max_points: int = MOST_POINTS,
    **arguments,
) -> Planes | TensorPlanes:
    """The mirror planes of a cloud, the most confident first.

    Every method sees the cloud centred and scaled to diagonal 1, in single precision, so that neither unit nor position
    (of a survey, say, millions of metres from its origin) costs accuracy. The same points give the same planes.

    It may be called from several threads, and in a process forked from one that has used torch.

    Args:
        points: (N, 3) real numbers in any unit, an array, anything that NumPy makes one of, or a tensor on any device.
        method: a name of conf/method, or a method that is ready for use.
        min_confidence: leave out planes below it; None takes the method's own threshold.
        max_planes: at most so many; None gives all.
        max_points: the method sees so many points of a larger cloud, drawn evenly at random, always the same.
        arguments: of the method, as in conf/method (`neighbours=250` for m3).

    Returns:
        Planes for arrays; for a tensor TensorPlanes on its device, of its type where that is a real one. Normals have
        their largest component positive, and each point is the plane's nearest to the cloud's centroid. None is a valid
        answer: `len(planes) == 0`, for tensors `len(planes.normals) == 0`.

    Raises:
        ValueError: for another shape, values that are not finite, points in one place or on a straight line (which have
            infinitely many mirror planes), an unknown method or argument, or a limit out of its range.
    """
    with one_thread() if forked() else nullcontext():
        return _detect(points, method, min_confidence, max_planes, max_points, arguments)


def _detect(points, method, min_confidence, max_planes, max_points: int, arguments: dict) -> Planes | TensorPlanes:
    _check_limits(min_confidence, max_planes, max_points)
    detector = _detector(method, arguments)
    frame = Frame.of(_as_array(points))
    threshold = detector.count_threshold if min_confidence is None else min_confidence
    device = points.device if isinstance(points, Tensor) else torch.device("cpu")
    if network := isinstance(detector, torch.nn.Module):
        detector.to(device).eval()
    with torch.no_grad(), nullcontext() if network else one_thread():
        seen = torch.from_numpy(frame.normalised(max_points)).to(device)
        found = detector.detect(seen)
        found = (refined(seen, found) if detector.refine else found).ranked()
    planes = frame.restored(found[found.confidences >= threshold][:max_planes])
    return _as_tensors(planes, points) if isinstance(points, Tensor) else planes


@dataclass(frozen=True, eq=False)
class Frame:
    """A cloud (N, 3) float64 with its box's centre (3,) and diagonal, and its centroid (3,) relative to that centre."""

    points: np.ndarray
    centre: np.ndarray
    diagonal: float
    centroid: np.ndarray

    @classmethod
    def of(cls, points: np.ndarray) -> "Frame":
        """Measure a cloud.

        Raises:
            ValueError: for a cloud that has no definite mirror planes.
        """
        low, high = (np.array([end(column) for column in points.T]) for end in (np.min, np.max))  # ten times axis=0
        with np.errstate(over="ignore"):
            diagonal = float(np.linalg.norm(high - low))
        if not np.isfinite(diagonal):
            raise ValueError("the points spread too far for double precision; scale them down")
        if diagonal <= np.finfo(np.float64).tiny:
            raise ValueError(f"all points ({len(points)}) are in one place, which has no definite mirror planes")
        centre = low + (high - low) / 2
        centroid = sum(block.sum(axis=0) for block in blocks(points, centre, diagonal)) / len(points)
        middle = centre + centroid * diagonal
        if is_straight(points, middle=middle, scale=diagonal):
            raise ValueError(
                f"all points ({len(points)}) are on a straight line, and every plane through it mirrors them; give "
                "points that spread in two directions or three"
            )
        return cls(points, centre, diagonal, centroid * diagonal)

    def normalised(self, count: int) -> np.ndarray:
        """The cloud in its frame, at most `count` points of it: (n, 3) float32."""
        points = self.points
        if len(points) > count:
            points = points[np.sort(np.random.default_rng(0).choice(len(points), count, replace=False))]
        return ((points - self.centre) / self.diagonal).astype(np.float32)

    def restored(self, planes: Planes) -> Planes:
        """Planes of the frame in the cloud's own coordinates, each through the foot of the centroid."""
        planes = planes.transformed(scale=self.diagonal, translation=-self.centroid).canonical()
        return planes.transformed(translation=self.centre + self.centroid)


def named_method(name: str, **arguments) -> Detector:
    """A method of conf/method with some arguments of its own; made once and kept.

    Raises:
        ValueError: for a name or an argument that is not there, naming those that are, or a value of the wrong kind.
    """
    return _made(name, json.dumps(arguments, sort_keys=True))


@functools.lru_cache(maxsize=8)
def _made(name: str, arguments: str) -> Detector:
    check_method_name(name)
    config, chosen = load([f"method={name}"]), json.loads(arguments)
    valid = sorted(key for key in config.method if key != "name")
    if unknown := sorted(set(chosen) - set(valid)):
        raise ValueError(f"method {name} has no argument {unknown[0]!r}; it has {', '.join(valid)}")
    try:
        config.method = OmegaConf.merge(config.method, chosen)
        return made(name, settings_of(config.method))
    except (ValueError, OmegaConfBaseException) as error:
        text = str(error.__cause__ or error).splitlines()[0]
        raise ValueError(text if text.startswith("method ") else f"method {name}: {text}") from error


def _detector(method: str | Detector, arguments: dict) -> Detector:
    if isinstance(method, str):
        return named_method(method, **arguments)
    if arguments:
        raise ValueError(f"{', '.join(arguments)} cannot change a method that is made already; name the method instead")
    return method


def _check_limits(min_confidence: float | None, max_planes: int | None, max_points: int) -> None:
    if min_confidence is not None and not np.isfinite(min_confidence):
        raise ValueError(f"min_confidence is {min_confidence}; it should be a finite number")
    for name, value in (("max_planes", max_planes), ("max_points", max_points)):
        if value is not None and value < 1:
            raise ValueError(f"{name} is {value}; it should be at least 1")


def _as_array(points: np.ndarray | Tensor) -> np.ndarray:
    """(N, 3) finite float64 of whatever was given."""
    if isinstance(points, Tensor):
        points = points.detach().to("cpu", torch.float64).numpy()
    points = np.asarray(points)
    if points.dtype.kind not in "fiub" or points.ndim != 2 or points.shape[1] != 3 or not len(points):
        zeros = "; add a column of zeros to a planar cloud" if points.ndim == 2 and points.shape[1] == 2 else ""
        raise ValueError(f"points are {points.dtype} {points.shape}, expected real numbers (N ≥ 1, 3){zeros}")
    points = points.astype(np.float64, copy=False)
    if not np.isfinite(points).all():
        finite = np.isfinite(points).all(axis=1)
        first, count = int(np.argmin(finite)), int((~finite).sum())
        raise ValueError(f"point {first} is {points[first].tolist()} ({count} such); remove what is not finite")
    return points


def _as_tensors(planes: Planes, points: Tensor) -> TensorPlanes:
    dtype = points.dtype if points.dtype.is_floating_point else torch.get_default_dtype()
    columns = (planes.normals, planes.points, planes.confidences)
    return TensorPlanes(*(torch.as_tensor(column, dtype=dtype, device=points.device) for column in columns))


def evaluate(
    *overrides: str,
    method: "str | SymmetryMethod | None" = None,
    folder: str | PathLike | None = None,
    config_dir: str | PathLike | None = None,
    **settings,
) -> dict:
    """A method over the test clouds, scored: what the command `symshrec evaluate` does, and the same stored run.

        symshrec.evaluate("experiment=m4", "data=smoke")["scores"]
        symshrec.evaluate(method=Mine(), data="quick", tolerance="sweep")

    Args:
        overrides: as on the command line, `KEY=VALUE`.
        method: a name of conf/method, or a SymmetryMethod that is ready for use. Its run is called as its class, unless
            `name` and `title` are set.
        folder: of the run; None takes runs/<data>/<name>/<what else was changed>.
        config_dir: a folder of your own configurations, searched after conf/.
        settings: overrides too: groups and keys at the top by name, and further ones as dictionaries, such as
            data="smoke", seed=1, trainer={"enable_progress_bar": False}.

    Returns:
        What metrics.json holds: `scores` is a list of {metric, group, theta_deg, epsilon, value}.

    Raises:
        ValueError: for an unknown key, a wrong value, or what the run cannot use, naming it.
    """
    from symshrec.runs import evaluate as runs  # Lightning, which `detect` does without

    ready = None if method is None or isinstance(method, str) else method
    if ready is not None and not isinstance(ready, runs.SymmetryMethod):
        raise ValueError(f"method is a {type(ready).__name__}; give the name of one, or a SymmetryMethod")
    config, words = _configuration(overrides, {"method": None if ready else method, **settings}, folder, config_dir)
    if ready is None:
        return runs.evaluate(config)
    from symshrec.runs.ready import described

    named = all(any(word.startswith(f"{key}=") for word in words) for key in ("name", "title"))
    return runs.evaluate(described(config, ready, named), ready)


def train(
    *overrides: str,
    folder: str | PathLike | None = None,
    config_dir: str | PathLike | None = None,
    **settings,
) -> dict | None:
    """Train a learned method, or go on where it was: what the command `symshrec train` does.

        symshrec.train("experiment=m1_r4_cpu", data="quick", train={"epochs": 1})

    Args:
        folder: of the training, `train.folder`; None takes runs/<data>/training/<name>.
        overrides, config_dir, settings: as for `evaluate`.

    Returns:
        What training.json holds; None where `train.max_minutes` ended it early.

    Raises:
        ValueError: as `evaluate`, and where the folder holds a training by other settings.
    """
    from symshrec.runs.train import train as run  # Lightning, which `detect` does without

    config, _ = _configuration(overrides, settings, None, config_dir)
    if folder is not None:
        config.train.folder = fspath(folder)
    return run(config)


def _configuration(
    overrides: tuple[str, ...], settings: dict, folder: str | PathLike | None, config_dir: str | PathLike | None
) -> tuple[DictConfig, list[str]]:
    """The configuration, and the overrides it was composed by."""
    if wrong := [each for each in overrides if not isinstance(each, str)]:
        raise ValueError(f"an override is {wrong[0]!r}; give strings of the form KEY=VALUE")
    words = [*overrides, *as_overrides(settings)]
    config = load(words, [] if config_dir is None else [config_dir])
    if folder is not None:
        config.folder = fspath(folder)
    return config, words
