"""§4.2 Scores by group: all clouds, each perturbation (Table 3), each curve family (Table 4), cylinder and cone."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from symshrec.benchmark.cloud import ALL_FAMILIES, ALL_SOLIDS, PERTURBATIONS, UNKNOWN, Labels
from symshrec.metrics.scores import Scores

ALL = "all"


class GroupScore(NamedTuple):
    """One value of one metric over one group of clouds at one tolerance pair, and its standard error."""

    metric: str
    group: str
    theta_deg: float
    epsilon: float
    value: float
    clouds: int
    standard_error: float


def group_masks(labels: Sequence[Labels]) -> dict[str, np.ndarray]:
    """The clouds (C,) bool of each group that has any: "all", perturbations, families, solids, in the tables' order.

    Names beyond the benchmark's own come after these, sorted; UNKNOWN makes no group.

    >>> masks = group_masks([Labels("citrus", "cone", "P1"), Labels("astroid", "cone")])
    >>> {name: mask.tolist() for name, mask in masks.items()}
    {'all': [True, True], 'P1': [True, False], 'astroid': [False, True], 'citrus': [True, False], 'cone': [True, True]}
    """
    masks = {ALL: np.ones(len(labels), bool)} if len(labels) else {}
    for field, known in (("perturbation", PERTURBATIONS), ("family", ALL_FAMILIES), ("solid", ALL_SOLIDS)):
        names = np.array([getattr(each, field) for each in labels], dtype=np.str_)
        present = set(names.tolist()) - {UNKNOWN}
        order = [name for name in known if name in present] + sorted(present.difference(known))
        masks.update({name: names == name for name in order})
    return masks


def grouped(scores: Scores, labels: Sequence[Labels]) -> list[GroupScore]:
    """Every metric of every group at every tolerance pair, in the long form that tables are made of.

    Args:
        scores: of C clouds. labels: of the same clouds, in the same order.

    Raises:
        ValueError: where the two differ in length.

    >>> from symshrec.metrics import evaluate
    >>> from symshrec.planes import PackedPlanes, Planes
    >>> planes = PackedPlanes.pack([Planes([[1, 0, 0]], [[0, 0, 0]])])
    >>> grouped(evaluate(planes, planes, diagonals=[1.0]), [Labels()])[0]
    GroupScore(metric='mAP', group='all', theta_deg=1.0, epsilon=0.01, value=1.0, clouds=1, standard_error=0.0)
    """
    if len(scores) != len(labels):
        raise ValueError(f"scores of {len(scores)} clouds and labels of {len(labels)} do not belong together")
    rows = []
    for group, mask in group_masks(labels).items():
        clouds, errors = int(mask.sum()), scores.standard_errors(mask)
        for metric, grid in scores.means(mask).items():
            for (theta, epsilon), value in np.ndenumerate(grid):
                tolerance = float(scores.thetas_deg[theta]), float(scores.epsilons[epsilon])
                error = float(errors[metric][theta, epsilon])
                rows.append(GroupScore(metric, group, *tolerance, float(value), clouds, error))
    return rows
