"""`symshrec symmetrise`: a cloud or mesh averaged with its mirror images."""

import argparse

import numpy as np

from symshrec.cli.shapes import Shape, open_shape, shape_parser, write
from symshrec.geometry.averaging import symmetrised
from symshrec.geometry.residuals import mismatch
from symshrec.geometry.triangles import MeshSurface
from symshrec.planes import Planes
from symshrec.scans.meshes import sample_surface


def parser() -> argparse.ArgumentParser:
    """The arguments of `symshrec symmetrise`."""
    return shape_parser(
        "symmetrise",
        "Average a cloud or a mesh with its mirror images: over the point group, where its planes make one, else over "
        "its most confident plane. Points and faces stay as many, in their order.",
        "all, where they make a group; else the first",
    )


def run(options: argparse.Namespace) -> None:
    """Write the symmetric shape, and print what was averaged and the asymmetry before and after.

    Raises:
        ValueError: as `open_shape`, and where planes named in --planes make no group.
    """
    shape = open_shape(options)
    name, transforms, planes = _group(shape, bool(options.planes))
    points = symmetrised(shape.points, transforms, shape.triangles)
    write(options.out, points, shape.triangles)
    before, after = (_asymmetry(each, shape.triangles, planes, options) for each in (shape.points, points))
    print(f"averaged over {name}: {len(transforms)} images; asymmetry {before:.5f} before, {after:.5f} after")


def _asymmetry(points: np.ndarray, triangles: np.ndarray | None, planes: Planes, options: argparse.Namespace) -> float:
    """The greatest asymmetry index to any of the planes."""
    if triangles is None:
        return float(mismatch(points, planes).asymmetries.max())
    drawn = sample_surface(points[triangles], options.samples, options.seed)
    if drawn is None:
        raise ValueError(f"the average of {options.source} has no area")
    return float(mismatch(drawn, planes, mesh=MeshSurface(points, triangles)).asymmetries.max())


def _group(shape: Shape, named: bool) -> tuple[str, np.ndarray, Planes]:
    """What is averaged over: in words, the elements (G, 4, 4), and the planes."""
    group = shape.planes.group(shape.diagonal)
    if group.complete or group.continuous:
        return group.name, group.transforms, shape.planes[list(group.planes)]
    if named:
        raise ValueError(f"--planes: {group.describe()}; name planes that make one, or one plane")
    first = shape.planes[0].group()
    return f"plane 1 ({group.describe()})", first.transforms, shape.planes[0]
