"""§2.3 The evaluation as a torchmetrics class: planes gathered batch by batch and across processes, scored at once."""

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor
from torchmetrics import Metric
from torchmetrics.utilities import dim_zero_cat

from symshrec.benchmark.cloud import Labels
from symshrec.files.predictions import take_clouds
from symshrec.metrics.scores import Scores, evaluate
from symshrec.planes import PackedPlanes, Planes

NAME_BYTES = 32  # a label in a tensor: UTF-8, padded with zeros
NAME_FIELDS = ("family", "solid", "perturbation")
STATES = {
    "clouds": ((3,), torch.int64),  # position, number of predicted planes, number of true planes
    "diagonals": ((), torch.float64),
    "names": ((len(NAME_FIELDS) * NAME_BYTES,), torch.uint8),
    "predicted": ((7,), torch.float64),  # normal, point, confidence
    "true": ((7,), torch.float64),
}


class SymmetryMetric(Metric):
    """All scores of §2.3 over the clouds seen, each cloud counted once however often it came.

    Matching a cloud needs its planes alone, so the states are the planes themselves, and the result depends neither on
    batch size, nor on order, nor on the number of processes. Clouds are known by their position in the split: the
    duplicates that distributed samplers add to fill a batch fall away.

    Args:
        thetas_deg: (T,) degrees in [0, 90]. epsilons: (E,) shares of the diagonal.
        count_threshold: the confidence from which the method means a plane to count.
        curves: also keep precision-recall curves.
        kwargs: of torchmetrics.Metric.

    >>> metric = SymmetryMetric()
    >>> planes = Planes([[1, 0, 0]], [[0, 0, 0]])
    >>> metric.update([planes], [planes], diagonals=[1.0], labels=[Labels()], positions=[0])
    >>> float(metric.compute()["mAP"])
    1.0
    """

    is_differentiable = False
    higher_is_better = True
    full_state_update = False

    def __init__(
        self,
        thetas_deg: Sequence[float] = (1.0,),
        epsilons: Sequence[float] = (0.01,),
        count_threshold: float = -np.inf,
        curves: bool = True,
        **kwargs,
    ):
        super().__init__(**kwargs)
        self.thetas_deg, self.epsilons = list(thetas_deg), list(epsilons)
        self.count_threshold, self.curves = float(count_threshold), curves
        for name in STATES:
            self.add_state(name, default=[], dist_reduce_fx="cat")

    def update(
        self,
        predicted: Sequence[Planes],
        truth: Sequence[Planes | None],
        diagonals: Sequence[float] | Tensor,
        labels: Sequence[Labels],
        positions: Sequence[int],
    ) -> None:
        """Add a batch of clouds, one entry of every argument per cloud; either side may have no planes.

        Raises:
            ValueError: where the lengths differ, a cloud's truth is withheld, or a label is longer than 32 bytes.
        """
        lengths = [len(each) for each in (predicted, truth, diagonals, labels, positions)]
        if len(set(lengths)) > 1:
            raise ValueError(
                f"predicted, truth, diagonals, labels, positions have lengths {lengths}; one per cloud each"
            )
        known = [planes for planes in truth if planes is not None]
        if len(known) < len(truth):
            withheld = positions[next(place for place, planes in enumerate(truth) if planes is None)]
            raise ValueError(f"the truth of cloud {withheld} is withheld; only clouds with true planes can be scored")
        found, true = PackedPlanes.pack(predicted), PackedPlanes.pack(known)
        clouds = np.stack([np.asarray(positions, dtype=np.int64), found.counts, true.counts], axis=1)
        self._append(clouds=clouds, diagonals=diagonals, names=_names(labels), predicted=_rows(found), true=_rows(true))

    def _append(self, **values) -> None:
        for name, (_, dtype) in STATES.items():
            getattr(self, name).append(torch.as_tensor(values[name], dtype=dtype, device=self.device))

    def compute(self) -> dict[str, Tensor]:
        """The five METRICS over all clouds: (T, E) float64 each, scalars where there is one tolerance pair.

        Raises:
            ValueError: where no cloud was seen.
        """
        means = self._evaluate()[0].means()
        return {name: torch.tensor(grid.copy(), device=self.device) for name, grid in means.items()}

    def evaluation(self) -> tuple[Scores, list[Labels], np.ndarray]:
        """Per-cloud scores, labels and positions of all clouds of all processes, by position.

        Every process of a group must call it, since it gathers.
        """
        with self.sync_context(dist_sync_fn=self.dist_sync_fn, should_sync=self._to_sync):
            return self._evaluate()

    def _sync_dist(self, *args, **kwargs) -> None:
        if not self.clouds:  # a process that saw no cloud must still gather tensors of the others' shapes
            self._append(**_no_clouds())
        super()._sync_dist(*args, **kwargs)

    def _evaluate(self) -> tuple[Scores, list[Labels], np.ndarray]:
        gathered = {}
        for name, none in _no_clouds().items():
            state = getattr(self, name)  # a list of tensors, or one tensor once gathered
            gathered[name] = dim_zero_cat([none.to(self.device), *(state if isinstance(state, list) else [state])])
        states = {name: state.cpu().numpy() for name, state in gathered.items()}
        positions, chosen = np.unique(states["clouds"][:, 0], return_index=True)
        predicted, truth = (
            take_clouds(_packed(states[name], states["clouds"][:, column]), chosen)
            for name, column in (("predicted", 1), ("true", 2))
        )
        tolerances = self.thetas_deg, self.epsilons, self.count_threshold, self.curves
        scores = evaluate(predicted, truth, states["diagonals"][chosen], *tolerances)
        return scores, _labels(states["names"][chosen]), positions


def _no_clouds() -> dict[str, Tensor]:
    return {name: torch.empty(0, *shape, dtype=dtype) for name, (shape, dtype) in STATES.items()}


def _rows(planes: PackedPlanes) -> np.ndarray:
    """(ΣK, 7): normal, point, confidence."""
    return np.column_stack([planes.normals, planes.points, planes.confidences])


def _packed(rows: np.ndarray, counts: np.ndarray) -> PackedPlanes:
    return PackedPlanes(rows[:, :3], rows[:, 3:6], rows[:, 6], np.concatenate([[0], np.cumsum(counts)]))


def _names(labels: Sequence[Labels]) -> np.ndarray:
    """(B, 3 · NAME_BYTES) uint8: family, solid and perturbation."""
    names = [getattr(each, field).encode() for each in labels for field in NAME_FIELDS]
    too_long = [name for name in names if len(name) > NAME_BYTES]
    if too_long:
        raise ValueError(f"label {too_long[0].decode()!r} is longer than {NAME_BYTES} bytes; shorten it")
    return np.array(names, dtype=f"S{NAME_BYTES}").view(np.uint8).reshape(len(labels), len(NAME_FIELDS) * NAME_BYTES)


def _labels(names: np.ndarray) -> list[Labels]:
    rows = names.view(f"S{NAME_BYTES}")
    return [Labels(**dict(zip(NAME_FIELDS, (name.decode() for name in row), strict=True))) for row in rows.tolist()]
