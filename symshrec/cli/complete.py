"""`symshrec complete`: the missing side of a scan, filled from its mirror image."""

import argparse

import numpy as np

from symshrec.cli.arguments import share
from symshrec.cli.shapes import Shape, open_shape, shape_parser, write
from symshrec.geometry.completion import unobserved
from symshrec.planes import Planes

SUPPORT = 0.7  # least, of a plane that a shape is completed by
INNER = np.array([[1, 1, 1], [4, 1, 1], [1, 4, 1], [1, 1, 4]]) / [[3], [6], [6], [6]]  # places inside a triangle


def parser() -> argparse.ArgumentParser:
    """The arguments of `symshrec complete`."""
    parser = shape_parser(
        "complete",
        "Fill what was not observed of a cloud or a mesh from its mirror image: where nothing is, and where the image "
        "continues the shape beyond an edge of it. What was observed stays as it is. Of a mesh, triangles are added "
        "that are not sewn to its own.",
        "the first",
    )
    parser.add_argument(
        "--min-support", type=share, default=SUPPORT, help=f"least support of a plane to complete by ({SUPPORT})"
    )
    return parser


def run(options: argparse.Namespace) -> None:
    """Write the completed shape, one plane after the other, and print how much each has added.

    Raises:
        ValueError: as `open_shape`, and where a plane has less support than --min-support.
    """
    from symshrec.methods.fit.judgement import supports  # torch

    shape = open_shape(options)
    planes, numbers = (shape.planes, options.planes) if options.planes else (shape.planes[0], [1])
    for number, support in zip(numbers, supports(shape.surface, planes), strict=True):
        if support < options.min_support:
            raise ValueError(
                f"plane {number} has support {support:.3f}, below --min-support {options.min_support:g}: too little of "
                "the surface has its mirror image; nothing is written"
            )
    for row, number in enumerate(numbers):
        before = len(shape.points if shape.triangles is None else shape.triangles)
        shape = completed(shape, planes[row])
        after = len(shape.points if shape.triangles is None else shape.triangles)
        what = "points" if shape.triangles is None else "triangles"
        print(f"plane {number}: {after - before:,} {what} added to {before:,}")
    write(options.out, shape.points, shape.triangles)


def completed(shape: Shape, plane: Planes) -> Shape:
    """The shape with what its image under one plane adds; of a mesh, triangles most of which lie where nothing is."""
    (images,) = plane.mirror(shape.points)
    (surface,) = plane.mirror(shape.surface)
    surface = np.concatenate([shape.surface, surface[unobserved(shape.surface, surface)]])
    if shape.triangles is None:
        return Shape(surface, None, surface, shape.planes)
    inside = np.einsum("ic,fcd->fid", INNER, images[shape.triangles])
    fill = unobserved(shape.surface, inside.reshape(-1, 3)).reshape(-1, len(INNER)).mean(axis=1) > 0.5
    used, places = np.unique(shape.triangles[fill][:, ::-1], return_inverse=True)  # turned round: a mirror image
    added = places.reshape(-1, 3) + len(shape.points)
    points, triangles = np.concatenate([shape.points, images[used]]), np.concatenate([shape.triangles, added])
    return Shape(points, triangles, surface, shape.planes)
