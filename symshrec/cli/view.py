"""`symshrec view`: a cloud with its true and predicted planes, in a window."""

import argparse
import sys
from pathlib import Path

import numpy as np

from symshrec.benchmark.official import OfficialFolder, read_planes, read_results
from symshrec.benchmark.shards import ShardedSplit
from symshrec.cli import EXIT_STATUSES
from symshrec.cli.arguments import whole
from symshrec.cli.sources import holds_shards, open_results, warnings_as_lines
from symshrec.geometry.residuals import mirror_deviations
from symshrec.geometry.triangles import MeshSurface
from symshrec.planes import Planes
from symshrec.reporting.figures import viewer
from symshrec.reporting.figures.subject import MAPPED
from symshrec.reporting.figures.viewer import Scene
from symshrec.scans import STDIN, STDIN_NAME, listed, read_cloud, stem_of
from symshrec.scans.polygons import Mesh

SHARDS_SPLIT = "test"  # as `symshrec score`


def parser() -> argparse.ArgumentParser:
    """The arguments of `symshrec view`."""
    parser = argparse.ArgumentParser(
        prog="symshrec view",
        description="Look at a cloud with its true planes (blue) and predicted planes (vermilion, or of "
        "several colours where no true ones are known). Needs Polyscope: pip install 'symshrec[view]'.",
        epilog=f"A file of a cloud or mesh is read as by detect: {listed()}. {EXIT_STATUSES}",
    )
    parser.add_argument(
        "source", type=Path, help="shards, a folder of the track's or its successor's, or a cloud's file"
    )
    parser.add_argument("id", nargs="?", type=whole, metavar="ID", help="which cloud of a folder (its first)")
    parser.add_argument("--split", help=f"which split of a folder; of shards: {SHARDS_SPLIT}")
    parser.add_argument(
        "--predictions", type=Path, metavar="FILE", help="our predictions, a folder of results, or one *_res.txt"
    )
    return parser


def run(options: argparse.Namespace) -> None:
    """Open the window, and tell on stderr what is in it."""
    viewer.require_window()
    with warnings_as_lines("view"):
        scene = open_scene(options.source, options.id, options.split, options.predictions)
    parts = [f"{len(scene.points):,} points"]
    for planes, what in ((scene.planes, "true"), (scene.predicted, "predicted")):
        parts.append(f"{what} planes unknown" if planes is None else f"{len(planes)} {what} planes")
    print(f"{scene.name}: {', '.join(parts)}", file=sys.stderr)
    viewer.show(_centred(scene))


def _centred(scene: Scene) -> Scene:
    """The scene moved to the origin, with its deviations."""
    surface, deviations = None if scene.mesh is None else MeshSurface(*scene.mesh), None
    if scene.predicted is not None:
        deviations = mirror_deviations(scene.points, scene.predicted[:MAPPED], surface)
    middle = np.min(scene.points, axis=0) + np.ptp(scene.points, axis=0) / 2
    planes, predicted = (each and each.transformed(translation=-middle) for each in (scene.planes, scene.predicted))
    mesh = scene.mesh and Mesh(scene.mesh.vertices - middle, scene.mesh.triangles)
    return Scene(scene.name, scene.points - middle, planes, predicted, mesh, deviations)


def open_scene(source: Path, cloud: int | None, split: str | None, predictions: Path | None) -> Scene:
    """Read one cloud with its planes.

    Args:
        source: a folder of clouds, or one file; the true planes of `points7.txt` are those of `points7_sym.txt`.
        cloud: its ID in the folder, None for the first.
        predictions: a predictions file or a folder of results by ID, or the results of this one cloud.

    Raises:
        ValueError: for an ID or predictions that are not there, and as the readers do.
    """
    if not source.is_dir():
        if cloud is not None or split is not None:
            raise ValueError(f"{source} is one file; an ID or --split is for a folder of clouds")
        return _file_scene(source, predictions)
    clouds: ShardedSplit | OfficialFolder
    if holds_shards(source):
        clouds = ShardedSplit(source, split or SHARDS_SPLIT, verify=False)
        ids = list(range(len(clouds)))
    else:
        clouds = OfficialFolder(source, split=split)
        ids = clouds.ids.tolist()
    cloud = ids[0] if cloud is None else cloud
    if cloud not in ids:
        raise ValueError(f"there is no cloud {cloud} in {source}; its IDs are from {ids[0]} to {ids[-1]}")
    labelled = clouds[ids.index(cloud)]
    return Scene(labelled.name, labelled.points, labelled.planes, _predicted(predictions, cloud))


def _file_scene(source: Path, predictions: Path | None) -> Scene:
    truth, name = source.with_name(f"{stem_of(source)}_sym.txt"), STDIN_NAME if source == STDIN else source.name
    planes = read_planes(truth) if truth.exists() else None
    found = read_cloud(source)
    for note in found.notes:
        print(f"{STDIN_NAME if source == STDIN else source}: {note}", file=sys.stderr)
    if predictions is not None and predictions.suffix != ".txt":
        raise ValueError(f"{predictions}: a single file's predictions are its *_res.txt; write it with detect --res")
    predicted = None if predictions is None else read_results(predictions)
    return Scene(name, found.points, planes, predicted, found.mesh)


def _predicted(predictions: Path | None, cloud: int) -> Planes | None:
    if predictions is None:
        return None
    if predictions.suffix == ".txt":
        return read_results(predictions)
    planes = open_results(predictions).get(cloud)
    if planes is None:
        raise ValueError(f"{predictions} holds nothing for cloud {cloud}; choose a cloud that it was made of")
    return planes
