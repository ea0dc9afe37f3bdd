"""§2.3 Evaluation: the organisers' mAP, PHC and precision-recall curve, and what they hide. NumPy here, torch in
`symshrec.metrics.torchmetric` alone, so that scoring a folder of results does not wait for torch to load."""

from symshrec.metrics.groups import GroupScore, group_masks, grouped
from symshrec.metrics.matching import Matches, PlaneErrors, match_planes, plane_errors
from symshrec.metrics.scores import METRICS, RECALL_BINS, Scores, evaluate

__all__ = [
    "METRICS",
    "RECALL_BINS",
    "GroupScore",
    "Matches",
    "PlaneErrors",
    "Scores",
    "evaluate",
    "group_masks",
    "grouped",
    "match_planes",
    "plane_errors",
]
