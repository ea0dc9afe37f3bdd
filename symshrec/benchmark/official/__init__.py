"""§2.2–2.3 The track's own files and those of its successor, in and out."""

from collections.abc import Iterable
from pathlib import Path

from symshrec.benchmark.cloud import LabelledCloud
from symshrec.benchmark.official.folder import OfficialFolder, chosen_ids
from symshrec.benchmark.official.layouts import LAYOUTS, SYMMETRIA, TRACK, Layout
from symshrec.benchmark.official.numbers import OfficialFileError
from symshrec.benchmark.official.results import ResultsFolder
from symshrec.benchmark.official.text import (
    RESULTS_FILE,
    ConfidenceWarning,
    confidences_outside,
    read_planes,
    read_points,
    read_results,
    read_subset,
    warn_of_confidences,
    write_planes,
    write_points,
    write_results,
)

__all__ = [
    "LAYOUTS",
    "RESULTS_FILE",
    "ConfidenceWarning",
    "Layout",
    "OfficialFileError",
    "OfficialFolder",
    "ResultsFolder",
    "chosen_ids",
    "confidences_outside",
    "read_planes",
    "read_points",
    "read_results",
    "read_subset",
    "warn_of_confidences",
    "write_planes",
    "write_points",
    "write_results",
    "write_symmetria",
    "write_track",
]


def write_track(clouds: Iterable[LabelledCloud], out: Path) -> None:
    """Write clouds into a folder as the track lays out a split: points<ID>.txt and, where known, points<ID>_sym.txt."""
    for cloud in clouds:
        TRACK.write(cloud, Path(out))


def write_symmetria(clouds: Iterable[LabelledCloud], out: Path) -> None:
    """Write clouds into a folder as the successor does: <class>/<ID>-<class>-<perturbation>.xz and -sym.txt."""
    for cloud in clouds:
        SYMMETRIA.write(cloud, Path(out))
