"""`symshrec export`: shards as the track's or its successor's text files, predictions as the track's results."""

import argparse
import hashlib
import sys
from collections.abc import Iterable
from functools import partial
from itertools import chain
from pathlib import Path

from symshrec.benchmark.manifest import json_text
from symshrec.benchmark.official import LAYOUTS, RESULTS_FILE, Layout, write_results
from symshrec.benchmark.shards import ShardedSplit, read_manifest
from symshrec.cli.arguments import count
from symshrec.cli.parallel import available_cores, over_clouds
from symshrec.cli.sources import PredictedResults, warnings_as_lines
from symshrec.files.atomic import remove_temporaries, write_atomically

UNFINISHED = ".unfinished-export.json"  # says what is being exported while it is, so that it can be taken up again


def parser() -> argparse.ArgumentParser:
    """The arguments of `symshrec export`."""
    parser = argparse.ArgumentParser(
        prog="symshrec export",
        description="Write shards as the track's or its successor's text files, or predictions as the track's results. "
        "Interrupted, the same command goes on where it was.",
    )
    parser.add_argument("source", type=Path, help="folder of shards, or a predictions file")
    parser.add_argument("out", type=Path, help="folder to write to, new or empty")
    parser.add_argument("--split", help="one split of the shards (all)")
    parser.add_argument("--format", choices=LAYOUTS, help="of clouds: the track's (default) or its successor's")
    parser.add_argument("--overwrite", action="store_true", help="replace what an earlier export left in the folder")
    parser.add_argument("--workers", type=count, default=available_cores(), help="processes (all cores)")
    return parser


def run(options: argparse.Namespace) -> None:
    """Export, and tell on stderr how much went where."""
    if options.source.is_file():
        if options.split or options.format:
            raise ValueError(f"{options.source} is a predictions file; --split and --format are for shards")
        export_predictions(options.source, options.out, options.overwrite)
    else:
        layout = LAYOUTS[options.format or "track"]
        splits = [options.split] if options.split else list(read_manifest(options.source).splits)
        export_shards(options.source, options.out, splits, layout, options.overwrite, options.workers)


def export_shards(
    root: Path, out: Path, splits: list[str], layout: Layout, overwrite: bool = False, workers: int = 1
) -> None:
    """Write whole splits below `out`, in the folders that the layout gives them.

    Raises:
        ShardError: as `ShardedSplit`.
        ValueError: where `out` holds anything but an unfinished export of the same, unless it is to be overwritten.
    """
    sources = {out / layout.split_folder.format(split=split): ShardedSplit(root, split) for split in splits}
    request = {"shards": read_manifest(root).hash, "splits": splits, "format": layout.name}
    earlier = (path for folder in sources for path, _, _ in layout.files(folder))
    claim(out, request, earlier, overwrite)
    for folder, clouds in sources.items():
        folder.mkdir(exist_ok=True)
        work = partial(_write_cloud, clouds, layout.name, folder)
        for _ in over_clouds(work, range(len(clouds)), folder.name, workers):
            pass
        for part in (folder, *(each for each in folder.iterdir() if each.is_dir())):
            remove_temporaries(part)
        print(f"{len(clouds)} clouds in {folder}", file=sys.stderr)
    release(out)


def _write_cloud(clouds: ShardedSplit, format_name: str, folder: Path, position: int) -> None:
    layout = LAYOUTS[format_name]
    points, _ = layout.paths(position, clouds.labels(position), folder)
    if not points.exists():  # written last, so the cloud is complete
        layout.write(clouds[position], folder)


def export_predictions(path: Path, out: Path, overwrite: bool = False) -> None:
    """Write one `points<ID>_res.txt` a cloud.

    Raises:
        PredictionFileError: as `load_predictions`.
        ValueError: as `export_shards`; also where two clouds have one ID.
    """
    with warnings_as_lines("export"):
        results = PredictedResults(path)
    request = {"predictions": hashlib.sha256(path.read_bytes()).hexdigest()}
    claim(out, request, out.glob(RESULTS_FILE.format(id="*")), overwrite)
    for _ in over_clouds(partial(_write_results, results, out), results.ids, out.name, workers=1):
        pass
    remove_temporaries(out)
    print(f"{len(results.ids)} results in {out}", file=sys.stderr)
    release(out)


def _write_results(results: PredictedResults, out: Path, cloud: int) -> None:
    planes = results.get(cloud)
    assert planes is not None  # `cloud` is one of `results.ids`
    write_results(out / RESULTS_FILE.format(id=cloud), planes)


def claim(out: Path, request: dict, earlier: Iterable[Path], overwrite: bool) -> None:
    """Take a folder for an export, new or begun before.

    Args:
        request: what is exported, to tell the same export from another.
        earlier: files that an export like this one would have left; removed where overwriting.

    Raises:
        ValueError: for a folder that holds anything else, unless `overwrite`.
    """
    marker, wanted = out / UNFINISHED, json_text(request)
    if marker.exists() and marker.read_text() == wanted:
        print(f"going on with the unfinished export in {out}", file=sys.stderr)
        return
    out.mkdir(parents=True, exist_ok=True)
    if any(out.iterdir()) and not overwrite:
        raise ValueError(f"{out} is not empty; choose another folder, or replace what is there with --overwrite")
    for path in chain(earlier, [marker]):
        path.unlink(missing_ok=True)
    write_atomically(marker, wanted.encode())


def release(out: Path) -> None:
    """Mark an export as finished."""
    (out / UNFINISHED).unlink()
