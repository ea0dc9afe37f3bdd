"""What was found in one file, as a table for people and as JSON for programs."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from symshrec import __version__
from symshrec.planes import Planes, PointGroup
from symshrec.scans import STDIN, STDIN_NAME, FileCloud
from symshrec.scans.palette import colour_code, colour_name, colour_number

FORMAT = "symshrec detections 1"  # a new number where a field changes its meaning or goes; new fields may come
HEADER = ["", "colour", "normal", "offset", "point", "confidence", "support", "mean residual", "% of diagonal"]
HEADER += ["asymmetry"]
SHARE = 5  # decimals of the asymmetry index
FIGURES = 6  # significant, of lengths beside the cloud's diagonal


@dataclass(frozen=True, eq=False)
class Measured:
    """K planes and of each, (K,): mean residual in the cloud's unit, support, and asymmetry index."""

    planes: Planes
    residuals: np.ndarray
    supports: np.ndarray
    asymmetries: np.ndarray

    def rows(self, diagonal: float) -> list[dict]:
        """One plane a row, as in the JSON."""
        planes = self.planes
        return [
            {
                "normal": planes.normals[row].tolist(),
                "offset": float(planes.offsets[row]),
                "point": planes.points[row].tolist(),
                "confidence": float(planes.confidences[row]),
                "support": float(self.supports[row]),
                "residual": float(self.residuals[row]),
                "residual_percent": float(100 * self.residuals[row] / diagonal),
                "asymmetry": float(self.asymmetries[row]),
            }
            for row in range(len(planes))
        ]


@dataclass(frozen=True, eq=False)
class Detection:
    """A file's cloud, the planes found in it, the group that they make, and the planes that are missing of it."""

    path: Path
    cloud: FileCloud
    found: Measured
    group: PointGroup
    missing: Measured

    @property
    def planes(self) -> Planes:
        """Those found, the most confident first."""
        return self.found.planes

    @cached_property
    def diagonal(self) -> float:
        """Length of the diagonal of the cloud's axis-aligned box."""
        return diagonal_of(self.cloud.points)

    @property
    def asymmetry(self) -> float | None:
        """The cloud's asymmetry index: the least of its planes', None without a plane."""
        return float(self.found.asymmetries.min()) if len(self.planes) else None

    def rows(self) -> list[dict]:
        """One plane a row, with its number and colour, as in the JSON."""
        rows = enumerate(self.found.rows(self.diagonal))
        return [{"number": row + 1, "colour": colour_code(self.colour(row)), **each} for row, each in rows]

    def colour(self, row: int) -> int:
        """The number that the plane at a place has its colour by."""
        return colour_number(self.planes, self.group, row)

    def group_fields(self) -> dict:
        """The group, as in the JSON; planes by their numbers."""
        group = self.group
        return {
            "name": group.name,
            "complete": group.complete,
            "text": group.describe(),
            "planes": [row + 1 for row in group.planes],
            "outside": [row + 1 for row in group.outside],
            "missing": self.missing.rows(self.diagonal),
            "centre": group.centre.tolist() if len(group.planes) else None,
            "axes": [{"direction": each.direction.tolist(), "order": each.order or None} for each in group.axes],
            "angle_deg": group.angle_deg,
            "distance": group.distance,
            "tolerance_deg": group.tolerance_deg,
        }


def diagonal_of(points: np.ndarray) -> float:
    """Length of the diagonal of the axis-aligned box of (N, 3) points."""
    return float(np.linalg.norm([np.ptp(column) for column in points.T]))


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
            "asymmetry": each.asymmetry,
            "planes": each.rows(),
            "group": each.group_fields(),
        }
        for each in detections
    ]
    about = {"format": FORMAT, "version": __version__, "method": method, "arguments": arguments}
    failed = [{"file": path, "error": error} for path, error in failures]
    found = {"min_confidence": min_confidence, "clouds": clouds, "failures": failed, "remaining": remaining}
    return json.dumps({**about, **found}, indent=1) + "\n"


def as_table(
    detection: Detection, min_confidence: float, listed: bool = False, mark: Callable[[str, int], str] | None = None
) -> str:
    """A heading, one line a plane with its columns aligned, and what group they make.

    Planes of a surface of revolution or of a sphere, which stand for infinitely many, are a sentence in place of lines,
    unless `listed`.

    Args:
        mark: makes a plane's number stand out in its colour, whose number is the second argument.
    """
    name = shown(detection.path)
    rows, diagonal, group = detection.rows(), detection.diagonal, detection.group
    points = f"{len(detection.cloud.points):,} points, diagonal {diagonal:.{FIGURES}g}"
    if not rows:
        return f"{name}: no mirror plane of confidence {min_confidence:g} or more ({points})"
    plural = "s" * (len(rows) > 1)
    points += f", asymmetry {detection.asymmetry:.{SHARE}f}"
    lines = [f"{name}: {len(rows)} mirror plane{plural} ({points})"]
    if group.continuous and not listed:
        rows = [rows[place] for place in group.outside]
    if rows:
        colours = [detection.colour(row["number"] - 1) for row in rows]
        cells = [
            [str(row["number"]), colour_name(colour), *_figures(row, diagonal)]
            for row, colour in zip(rows, colours, strict=True)
        ]
        header, *aligned = _aligned([HEADER, *cells])
        wide = max(len(number) for number, *_ in cells)
        if mark is not None:
            aligned = [mark(each[:wide], colour) + each[wide:] for each, colour in zip(aligned, colours, strict=True)]
        lines += [header, *aligned]
    missing = [["missing", "", *_figures(row, diagonal)] for row in detection.missing.rows(diagonal)]
    return "\n".join([*lines, group.describe(), *(_aligned(missing) if missing else [])])


def _figures(row: dict, diagonal: float) -> list[str]:
    decimals = max(0, FIGURES - 1 - int(np.floor(np.log10(diagonal))))
    return [
        _vector(row["normal"], 5),
        f"{row['offset']:.{decimals}f}",
        _vector(row["point"], decimals),
        f"{row['confidence']:.3f}",
        f"{row['support']:.3f}",
        f"{row['residual']:.3g}",
        f"{row['residual_percent']:.3f}",
        f"{row['asymmetry']:.{SHARE}f}",
    ]


def _aligned(cells: list[list[str]]) -> list[str]:
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    return ["  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True)) for row in cells]


def shown(path: Path) -> str:
    """A file's name for people."""
    return STDIN_NAME if path == STDIN else printable(path)


def printable(text: str | Path) -> str:
    """Text with escapes for line ends, control characters and bytes of a file's name that are no characters."""
    return "".join(each if each.isprintable() else each.encode("unicode_escape").decode() for each in str(text))


def _vector(values: list[float], decimals: int) -> str:
    texts = (f"{value:.{decimals}f}" for value in values)
    return " ".join(text.replace("-", "", 1) if not float(text) else text for text in texts)
