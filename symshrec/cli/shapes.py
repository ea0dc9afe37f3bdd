"""What `symshrec symmetrise`, `complete` and `align` share: a shape in, its planes, and a shape out."""

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from symshrec.cli import EXIT_STATUSES
from symshrec.cli.arguments import add_detection, count
from symshrec.cli.outputs import make_folder
from symshrec.planes import Planes
from symshrec.scans import read_cloud
from symshrec.scans.report import diagonal_of, printable, shown
from symshrec.scans.writing import WITH_FACES, WITHOUT_FACES, check_writable, write_shape


@dataclass(frozen=True, eq=False)
class Shape:
    """A file's shape and its planes.

    Attributes:
        points: (N, 3) of a cloud; the vertices of a mesh. triangles: (F, 3) of a mesh, None of a cloud.
        surface: (S, 3), the points that the planes were found on.
        planes: chosen ones, in the order asked for.
    """

    points: np.ndarray
    triangles: np.ndarray | None
    surface: np.ndarray
    planes: Planes

    @property
    def middle(self) -> np.ndarray:
        """The centroid (3,): of the points, or of the area of a mesh."""
        if self.triangles is None:
            return self.points.mean(axis=0)
        a, b, c = self.points[self.triangles].swapaxes(0, 1)
        return np.average((a + b + c) / 3, axis=0, weights=np.linalg.norm(np.cross(b - a, c - a), axis=1))

    @property
    def diagonal(self) -> float:
        """Of the axis-aligned box."""
        return diagonal_of(self.surface)


def shape_parser(command: str, description: str, planes: str) -> argparse.ArgumentParser:
    """The arguments that all three take; `planes` says which are taken where none are named."""
    parser = argparse.ArgumentParser(
        prog=f"symshrec {command}",
        description=description,
        epilog=f"Reads what symshrec detect reads. A mesh is written with its faces ({', '.join(WITH_FACES)}), a cloud "
        f"as points ({', '.join(WITHOUT_FACES)}), in the file's own unit; its folder is made. Colours and the like are "
        f"left out. {EXIT_STATUSES}",
    )
    parser.add_argument("source", type=Path, metavar="IN", help="a cloud or a mesh; - for standard input")
    parser.add_argument("out", type=Path, metavar="OUT", help="what to write; another file than IN")
    parser.add_argument(
        "--planes", type=count, nargs="+", metavar="N", help=f"by their numbers in symshrec detect's table ({planes})"
    )
    add_detection(parser)
    return parser


def open_shape(options: argparse.Namespace) -> Shape:
    """Read, refuse what could not be written, detect, and choose the planes.

    Raises:
        ValueError: for an OUT that is IN or cannot hold the shape, for a shape without a plane, for a number that no
            plane has, and as `read_cloud` and `detect`.
    """
    from symshrec.cli.detect import detector

    source, out = options.source, options.out
    if out.exists() and source.exists() and out.samefile(source):
        raise ValueError(f"{out} is the file that is read; name another one to write")
    if out.suffix.lower() not in (*WITH_FACES, *WITHOUT_FACES):
        check_writable(out, faces=False)
    cloud = read_cloud(source, options.samples, options.seed)
    check_writable(out, faces=cloud.mesh is not None)
    make_folder(out, str(out))
    detect, threshold = detector(options)
    planes = detect(cloud.points)
    if not len(planes):
        raise ValueError(f"{shown(source)}: no mirror plane of confidence {threshold:g} or more; nothing is written")
    chosen = [number - 1 for number in options.planes or range(1, len(planes) + 1)]
    if max(chosen) >= len(planes):
        raise ValueError(f"--planes {max(chosen) + 1}: {shown(source)} has {len(planes)}, numbered from 1")
    for note in cloud.notes:
        print(f"{shown(source)}: {note}", file=sys.stderr)
    points, triangles = (cloud.points, None) if cloud.mesh is None else cloud.mesh
    return Shape(points, triangles, cloud.points, planes[chosen])


def write(path: Path, points: np.ndarray, triangles: np.ndarray | None) -> None:
    """Write the shape, and say so on stderr."""
    write_shape(path, points, triangles)
    faces = "" if triangles is None else f", {len(triangles):,} triangles"
    print(f"{printable(path)}: {len(points):,} {'points' if triangles is None else 'vertices'}{faces}", file=sys.stderr)
