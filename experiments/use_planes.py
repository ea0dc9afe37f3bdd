"""A scan completed and a bent shape symmetrised, before and after: results/figures/use.png."""

import argparse
import contextlib
import sys
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from symshrec import detect
from symshrec.cli import main
from symshrec.files.atomic import write_atomically
from symshrec.geometry.residuals import mirror_deviations
from symshrec.planes import Planes
from symshrec.reporting.figures.outlines import outline, view_of
from symshrec.reporting.figures.raster import Canvas, Pane, render, splat
from symshrec.reporting.figures.shading import GREY, shaded
from symshrec.reporting.figures.subject import Subject
from symshrec.scans import read_cloud
from symshrec.scans.example import example_plane, write_example
from symshrec.scans.palette import colour_code

OUT, SIZE, POINT, DOT = Path("results/figures/use.png"), 900, 0.9, 5  # pixels across a panel; of a point's radius
CUT, ABOVE = 0.03, 0.6  # what the scan lacks: metres beyond the middle, and above which share of the height
LEAN = 0.04  # metres that one side of the bent chair leans by at its top


def panel(subject: Subject, canvas: Canvas, added: int = 0) -> np.ndarray:
    """Pixels of a shape with its plane; points after the first `added` in the plane's colour, where not 0."""
    colours = np.tile(GREY, (len(subject.points), 1))
    colours[added or len(colours) :] = to_rgb(colour_code(1))
    depth, image = shaded(subject, canvas, POINT) if not added else splat(canvas, subject.points, colours, DOT)
    corners = outline(subject.points, subject.planes.normals[0], subject.planes.points[0])
    return render(canvas, depth, image, [Pane(corners, colour_code(1), 0.12)])


def draw() -> bytes:
    """Run both commands as a user would, and draw what they were given and what they wrote."""
    write_example(Path("chair.ply"))
    chair, plane = read_cloud("chair.ply", samples=12_000).points, example_plane()
    beside = (chair - plane.points) @ plane.normals[0]
    height = (chair[:, 2] - chair[:, 2].min()) / np.ptp(chair[:, 2])
    np.save("scan.npy", chair[(beside < CUT) | (height < ABOVE)])
    np.save("bent.npy", chair + LEAN * (height**2 * (beside > 0))[:, None] * plane.normals[0])
    for words in (
        ["complete", "scan.npy", "whole.npy"],
        ["symmetrise", "bent.npy", "even.npy"],
    ):
        if main(words):
            sys.exit(f"symshrec {' '.join(words)} failed")
    scan, whole, bent, even = (np.load(f"{name}.npy") for name in ("scan", "whole", "bent", "even"))
    shapes = [Subject(each, plane) for each in (scan, whole)]
    found = detect(bent)[0]  # that it was symmetrised by
    for each in (bent, even):
        shapes.append(Subject(each, found, deviations=mirror_deviations(each, found)[0], span=LEAN / 2))
    return figure(shapes, [len(scan), len(scan), 0, 0], plane)


def figure(shapes: list[Subject], added: list[int], plane: Planes) -> bytes:
    """A png of four panels."""
    sheet, content = Figure((12, 3.3)), BytesIO()
    canvas = Canvas.around(view_of(plane), np.concatenate([each.points for each in shapes]), SIZE, margin=0.08)
    titles = ("a scan", "complete", "a bent shape", "symmetrise")
    for ax, shape, first, title in zip(sheet.subplots(1, 4), shapes, added, titles, strict=True):
        ax.imshow(panel(shape, canvas, first))
        ax.set_axis_off()
        ax.set_title(title, fontsize=12)
    sheet.subplots_adjust(0.005, 0.01, 0.995, 0.9, 0.02)
    sheet.savefig(content, format="png", dpi=100, metadata={"Software": None})
    return content.getvalue()


if __name__ == "__main__":
    argparse.ArgumentParser(description=__doc__).parse_args()
    with TemporaryDirectory() as folder, contextlib.chdir(folder):
        content = draw()
    write_atomically(OUT, content)
