"""`symshrec align`: a cloud or mesh brought upright by its planes."""

import argparse

from symshrec.cli.shapes import open_shape, shape_parser, write
from symshrec.geometry.frames import aligning_transform


def parser() -> argparse.ArgumentParser:
    """The arguments of `symshrec align`."""
    return shape_parser(
        "align",
        "Move and turn a cloud or a mesh so that its first plane is x = 0 and its second y = 0, and print the 4×4 "
        "matrix that does it. Where there is one plane alone, the centroid comes to y = z = 0.",
        "as they are, the most confident first",
    )


def run(options: argparse.Namespace) -> None:
    """Write the aligned shape, and print the matrix, row by row, for columns (x, y, z, 1).

    Raises:
        ValueError: as `open_shape`.
    """
    shape = open_shape(options)
    transform = aligning_transform(shape.planes, shape.middle)
    write(options.out, shape.points @ transform[:3, :3].T + transform[:3, 3], shape.triangles)
    for row in transform:
        print(" ".join(f"{value:.12g}" for value in row))
