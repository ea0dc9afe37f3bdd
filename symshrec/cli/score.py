"""§2.3 `symshrec score`: anyone's results as the organisers scored them, and what their two numbers hide."""

import argparse
import json
import sys
import warnings
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from symshrec.benchmark.official import RESULTS_FILE, ConfidenceWarning, confidences_outside
from symshrec.cli.arguments import angle, count, share
from symshrec.cli.parallel import available_cores, over_clouds
from symshrec.cli.sources import Results, Truth, open_results, open_truth
from symshrec.metrics import METRICS, Scores, evaluate, group_masks
from symshrec.planes import PackedPlanes, Planes

DESCRIPTION = (
    "Score results as the track's organisers did, and show what their two numbers hide. A cloud without a result "
    "counts 0. Recall-aware mAP and recall count missed planes, which mAP and PHC do not."
)
NAMED = 5  # missing or unknown IDs named on stderr; --json lists all


def parser() -> argparse.ArgumentParser:
    """The arguments of `symshrec score`."""
    parser = argparse.ArgumentParser(prog="symshrec score", description=DESCRIPTION)
    parser.add_argument("results", type=Path, help="folder of points<ID>_res.txt, or our predictions file")
    parser.add_argument("truth", type=Path, help="folder of points<ID>_sym.txt with their points, or our shards")
    parser.add_argument("--points", type=Path, metavar="DIR", help="where the points are, if not with the truth")
    parser.add_argument("--split", help="which split of the truth; of shards: test")
    parser.add_argument("--subset", type=Path, metavar="LIST", help="score these clouds only; a file of one ID a line")
    parser.add_argument("--theta-deg", type=angle, default=1.0, help="largest angle of a match, 0 to 90 degrees (1)")
    parser.add_argument("--epsilon", type=share, default=0.01, help="largest offset as a share of the diagonal (0.01)")
    parser.add_argument(
        "--count-threshold",
        type=float,
        help="confidence from which a plane counts for count accuracy (default: the predictions file's own, or all do)",
    )
    parser.add_argument("--workers", type=count, default=available_cores(), help="processes (all cores)")
    parser.add_argument("--json", action="store_true", help="print everything as JSON")
    return parser


def run(options: argparse.Namespace) -> None:
    """Score, tell on stderr what is missing, and print a table or JSON."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConfidenceWarning)  # of which one line says it all below
        results = open_results(options.results)
    truth = open_truth(options.truth, options.split, options.subset, options.points)
    threshold = options.count_threshold
    if threshold is None:
        threshold = getattr(results, "count_threshold", None)
    threshold = -np.inf if threshold is None else threshold
    report = score(results, truth, options.theta_deg, options.epsilon, threshold, options.workers)
    for ids, what in (
        (report.missing, f"of {len(truth.ids)} results are missing and count 0"),
        (report.unknown, "results are of clouds that the truth does not hold and do not count"),
    ):
        if ids:
            names = [RESULTS_FILE.format(id=cloud) for cloud in ids[:NAMED]]
            print(f"{len(ids)} {what}: {', '.join(names)}{', ...' * (len(ids) > NAMED)}", file=sys.stderr)
    if report.odd:
        file = options.results
        if not file.is_file():
            file = file / RESULTS_FILE.format(id=next(iter(report.odd)))
        clouds = f" (in {len(report.odd)} clouds)" * (len(report.odd) > 1)
        outside = f"{sum(report.odd.values())} confidences are outside [0, 1]{clouds}"
        print(f"{file}: {outside}; they are ranked as they are", file=sys.stderr)
    print(report.as_json() if options.json else report.as_table())


@dataclass(frozen=True)
class Report:
    """Scores of C clouds, the clouds (C,) bool of each group, and the IDs without result and without truth.

    odd: how many of a cloud's confidences are outside [0, 1], by the IDs of clouds that have such.
    """

    scores: Scores
    groups: dict[str, np.ndarray]
    missing: list[int]
    unknown: list[int]
    odd: dict[int, int]

    def as_table(self) -> str:
        """One line a group, columns aligned."""
        header = ["", "clouds", *(metric.replace("_", " ").replace("aware mAP", "aware mAP") for metric in METRICS)]
        rows = [
            [group, str(int(mask.sum())), *(f"{value:.3f}" for value in self.scores.mean(mask=mask).values())]
            for group, mask in self.groups.items()
        ]
        widths = [max(map(len, column)) for column in zip(header, *rows, strict=True)]
        return "\n".join(
            "  ".join(cell.rjust(width) if place else cell.ljust(width) for place, (cell, width) in enumerate(cells))
            for cells in (list(zip(row, widths, strict=True)) for row in [header, *rows])
        )

    def as_json(self) -> str:
        """Everything, with the precision at recall 0, 0.1, …, 1 over all clouds; a threshold of −∞ is null."""
        scores = self.scores
        threshold = scores.count_threshold
        return json.dumps(
            {
                "theta_deg": float(scores.thetas_deg[0]),
                "epsilon": float(scores.epsilons[0]),
                "count_threshold": threshold if np.isfinite(threshold) else None,
                "scores": {
                    group: {"clouds": int(mask.sum()), **scores.mean(mask=mask)} for group, mask in self.groups.items()
                },
                "precision_at_recall": scores.mean_curve().tolist(),
                "missing": self.missing,
                "unknown": self.unknown,
            },
            indent=1,
        )


def score(
    results: Results, truth: Truth, theta_deg: float, epsilon: float, count_threshold: float, workers: int
) -> Report:
    """Read and score; a cloud without a result scores 0 throughout.

    Raises:
        ValueError: for tolerances out of range; otherwise as the files' readers.
    """
    read = partial(_case, results, truth)
    cases = list(over_clouds(read, range(len(truth.ids)), "reading", workers))
    diagonals, planes, predicted = zip(*cases, strict=True)
    missing = np.array([each is None for each in predicted])
    scores = evaluate(
        PackedPlanes.pack([each or Planes.empty() for each in predicted]),
        PackedPlanes.pack(planes),
        np.array(diagonals),
        [theta_deg],
        [epsilon],
        count_threshold,
    )
    for values in (scores.recall_aware_ap, scores.recall, scores.count_correct):
        values[..., missing] = 0  # an empty answer could be right where there is no plane; no answer is not
    labels = [truth.clouds.labels(position) for position in truth.positions.tolist()]
    unknown = np.setdiff1d(np.array(results.ids, dtype=np.int64), truth.known)
    outside = [0 if each is None else confidences_outside(each.confidences) for each in predicted]
    odd = {cloud: count for cloud, count in zip(truth.ids.tolist(), outside, strict=True) if count}
    return Report(scores, group_masks(labels), truth.ids[missing].tolist(), unknown.tolist(), odd)


def _case(results: Results, truth: Truth, place: int) -> tuple[float, Planes, Planes | None]:
    """Diagonal, true planes and predicted planes of one cloud; None for a missing result."""
    cloud = truth.clouds[int(truth.positions[place])]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConfidenceWarning)  # counted by `score`
        return cloud.diagonal, cloud.truth, results.get(cloud.id)
