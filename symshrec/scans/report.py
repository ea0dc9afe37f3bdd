"""What was found in one file, as a table for people and as JSON for programs."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from symshrec import __version__
from symshrec.planes import Planes
from symshrec.scans import STDIN, STDIN_NAME, FileCloud

FORMAT = "symshrec detections 1"  # a new number where a field changes its meaning or goes; new fields may come
FIGURES = 6  # significant, of lengths beside the cloud's diagonal


@dataclass(frozen=True, eq=False)
class Detection:
    """A file's cloud, its planes, and of each plane the mean residual (K,) in the cloud's unit and its support (K,)."""

    path: Path
    cloud: FileCloud
    planes: Planes
    residuals: np.ndarray
    supports: np.ndarray

    @cached_property
    def diagonal(self) -> float:
        """Length of the diagonal of the cloud's axis-aligned box."""
        return float(np.linalg.norm([np.ptp(column) for column in self.cloud.points.T]))

    def rows(self) -> list[dict]:
        """One plane a row, as in the JSON."""
        planes, diagonal = self.planes, self.diagonal
        return [
            {
                "normal": planes.normals[row].tolist(),
                "offset": float(planes.offsets[row]),
                "point": planes.points[row].tolist(),
                "confidence": float(planes.confidences[row]),
                "support": float(self.supports[row]),
                "residual": float(self.residuals[row]),
                "residual_percent": float(100 * self.residuals[row] / diagonal),
            }
            for row in range(len(planes))
        ]


def as_json(
    detections: list[Detection],
    method: str,
    arguments: dict,
    min_confidence: float,
    failures: list[tuple[str, str]],
    remaining: list[str],
) -> str:
    """All that was found, of each file that failed its error, and the files that were not come to."""
    clouds = [
        {
            "file": str(each.path),
            "points": len(each.cloud.points),
            "triangles": each.cloud.triangles,
            "diagonal": each.diagonal,
            "notes": list(each.cloud.notes),
            "planes": each.rows(),
        }
        for each in detections
    ]
    about = {"format": FORMAT, "version": __version__, "method": method, "arguments": arguments}
    failed = [{"file": path, "error": error} for path, error in failures]
    found = {"min_confidence": min_confidence, "clouds": clouds, "failures": failed, "remaining": remaining}
    return json.dumps({**about, **found}, indent=1) + "\n"


def as_table(detection: Detection, min_confidence: float, mark: Callable[[str], str] = str) -> str:
    """A heading, and one line a plane with its columns aligned; `mark` makes the planes' numbers stand out."""
    name = shown(detection.path)
    rows, diagonal = detection.rows(), detection.diagonal
    points = f"{len(detection.cloud.points):,} points, diagonal {diagonal:.{FIGURES}g}"
    if not rows:
        return f"{name}: no mirror plane of confidence {min_confidence:g} or more ({points})"
    plural = "s" * (len(rows) > 1)
    decimals = max(0, FIGURES - 1 - int(np.floor(np.log10(diagonal))))
    header = ["", "normal", "offset", "point", "confidence", "support", "mean residual", "% of diagonal"]
    cells = [
        [
            str(number),
            _vector(row["normal"], 5),
            f"{row['offset']:.{decimals}f}",
            _vector(row["point"], decimals),
            f"{row['confidence']:.3f}",
            f"{row['support']:.3f}",
            f"{row['residual']:.3g}",
            f"{row['residual_percent']:.3f}",
        ]
        for number, row in enumerate(rows, 1)
    ]
    widths = [max(map(len, column)) for column in zip(header, *cells, strict=True)]
    aligned = [[cell.rjust(width) for cell, width in zip(row, widths, strict=True)] for row in [header, *cells]]
    lines = ["  ".join([mark(number), *rest]) for number, *rest in aligned]
    return "\n".join([f"{name}: {len(rows)} mirror plane{plural} ({points})", *lines])


def shown(path: Path) -> str:
    """A file's name for people."""
    return STDIN_NAME if path == STDIN else printable(path)


def printable(text: str | Path) -> str:
    """Text with escapes for line ends, control characters and bytes of a file's name that are no characters."""
    return "".join(each if each.isprintable() else each.encode("unicode_escape").decode() for each in str(text))


def _vector(values: list[float], decimals: int) -> str:
    texts = (f"{value:.{decimals}f}" for value in values)
    return " ".join(text.replace("-", "", 1) if not float(text) else text for text in texts)
