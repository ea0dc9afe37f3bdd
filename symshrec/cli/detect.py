"""`symshrec detect`: the mirror planes of anyone's clouds and meshes."""

import argparse
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import cast

from tqdm import tqdm

from symshrec.cli import EXIT_STATUSES
from symshrec.cli.arguments import add_detection, count, factor, tolerance, whole
from symshrec.cli.colours import RED, painted
from symshrec.cli.outputs import STEM
from symshrec.cli.products import check_outputs, write_outputs
from symshrec.files.atomic import write_atomically
from symshrec.geometry.residuals import mismatch
from symshrec.planes import Planes
from symshrec.planes.groups import ANGLE_DEG
from symshrec.scans import MOST_SAMPLES, SAMPLES, STDIN, listed, read_cloud
from symshrec.scans.example import EXAMPLE, write_example
from symshrec.scans.palette import colour_escape
from symshrec.scans.report import Detection, Measured, as_json, as_table, diagonal_of, printable, shown

Detect = Callable[..., Planes]


def parser() -> argparse.ArgumentParser:
    """The arguments of `symshrec detect`."""
    parser = argparse.ArgumentParser(
        prog="symshrec detect",
        description="Find the mirror planes of clouds and meshes, in their own coordinates.",
        epilog=f"Reads {listed()}. With several files, OUT of --plot, --res and --deviation holds {STEM}, the file's "
        f"name without its extension; folders are made. {EXIT_STATUSES} A cloud without a mirror plane is an answer "
        "too: 0. Of several files, those that can be read are done, and one that cannot makes it 2.",
    )
    parser.add_argument(
        "files", nargs="*", type=Path, metavar="FILE", help="clouds, or meshes to draw points on; - for standard input"
    )
    parser.add_argument("--example", action="store_true", help=f"write {EXAMPLE}, a chair, here and detect on it too")
    add_detection(parser)
    parser.add_argument("--max-planes", type=count, metavar="N", help="the N most confident at most (all)")
    parser.add_argument(
        "--group-deg", type=tolerance, default=ANGLE_DEG, help=f"that a plane may be off in a group ({ANGLE_DEG:g})"
    )
    parser.add_argument("--list", action="store_true", help="a line for each plane of a surface of revolution too")
    parser.add_argument(
        "--json", metavar="OUT", help="write all that was found; - to standard output, in place of tables"
    )
    parser.add_argument("--plot", metavar="OUT", help="draw cloud and planes; .png, or .html to turn in a browser")
    parser.add_argument(
        "--colour", choices=("plain", "deviation"), default="plain", help="of the points in --plot (plain)"
    )
    parser.add_argument(
        "--deviation", metavar="OUT", help="write the points with their signed distance from the mirror image; .ply"
    )
    parser.add_argument(
        "--plane", type=count, default=1, metavar="N", help="that deviations are to, by its number in the table (1)"
    )
    parser.add_argument(
        "--bop", metavar="OUT", help="put the rotations that the planes make into BOP's models_info.json, in mm; .json"
    )
    parser.add_argument("--bop-id", type=whole, metavar="N", help="of the object there (of obj_000005.ply 5; else 1)")
    parser.add_argument(
        "--bop-scale", type=factor, default=1.0, metavar="MM", help="millimetres in the file's unit (1)"
    )
    parser.add_argument("--res", metavar="OUT", help="write the planes as the track's results, OUT_res.txt")
    return parser


@dataclass
class Found:
    """What a batch of files has given so far; `remaining` were not come to."""

    remaining: list[Path]
    detections: list[Detection] = field(default_factory=list)
    failures: list[tuple[Path, str]] = field(default_factory=list)


def run(options: argparse.Namespace) -> None:
    """Detect on every file, one after the other, and print a table each; a file that fails is a line on stderr.

    Whatever happens to a file, the others are done; whatever ends the batch, Ctrl-C too, what was found is written.

    Raises:
        ValueError: for arguments that do not go together, and after all else where a file failed.
    """
    files = [*options.files, *([Path(EXAMPLE)] if options.example else [])]
    _check(options, files)
    if options.example:
        write_example(Path(EXAMPLE))
    detect, threshold = detector(options)
    found = Found(list(files))
    try:
        for path in tqdm(files, unit=" files", disable=None if len(files) > 1 else True):
            _detect_one(path, detect, threshold, options, found, alone=len(files) == 1)
            found.remaining.pop(0)
    finally:
        if options.json:
            failures = [(str(path), error) for path, error in found.failures]
            remaining = [str(path) for path in found.remaining]
            about = (options.method, dict(options.set), threshold)
            text = as_json(found.detections, *about, failures, remaining)
            print(text, end="") if options.json == "-" else write_atomically(Path(options.json), text.encode())
    if found.failures:
        (_, first), count = found.failures[0], len(found.failures)
        raise ValueError(first if len(files) == 1 else f"{count} of {len(files)} files failed, as named above")


def _detect_one(path: Path, detect: Detect, threshold: float, options, found: Found, alone: bool) -> None:
    """Detect on one file and keep what comes of it: a detection, or the line that says why there is none."""
    try:
        detection = detect_file(path, detect, options.samples, options.seed, options.group_deg)
        notes = write_outputs(detection, options)
    except Exception as error:  # whatever a file of a batch may do, the others are still to be done
        found.failures.append((path, _as_line(path, error)))
        if not alone:
            _say(f"{painted('symshrec detect:', RED, sys.stderr)} {found.failures[-1][1]}", sys.stderr)
        return
    found.detections.append(detection)
    for note in (*detection.cloud.notes, *notes):
        _say(f"{shown(path)}: {note}", sys.stderr)
    if options.json != "-":
        _say(as_table(detection, threshold, options.list, _in_colour), sys.stdout)


def _in_colour(text: str, colour: int) -> str:
    return painted(text, colour_escape(colour), sys.stdout)


def detect_file(
    path: Path, detect: Detect, samples: int = SAMPLES, seed: int = 0, group_deg: float = ANGLE_DEG
) -> Detection:
    """Read one file, detect, measure every plane, and name their group; errors as `read_cloud` and `detect`."""
    from symshrec.methods.fit.judgement import supports  # torch: see `detector`

    cloud = read_cloud(path, samples, seed)
    planes, diagonal = detect(cloud.points), diagonal_of(cloud.points)
    group = planes.group(diagonal, group_deg)
    surface = cloud.surface if len(planes) else None
    found, missing = (
        Measured(each, residuals, supports(cloud.points, each), asymmetries)
        for each in (planes, group.missing)
        for residuals, asymmetries in [mismatch(cloud.points, each, mesh=surface)]
    )
    return Detection(path, cloud, found, group, missing)


def detector(options: argparse.Namespace) -> tuple[Detect, float]:
    """What finds the planes of points, and the least confidence of those that it gives, by a command's options."""
    from symshrec.api import detect, named_method  # torch: after the arguments are known to be right

    method = named_method(options.method, **dict(options.set))
    threshold = method.count_threshold if options.min_confidence is None else options.min_confidence
    finds = partial(detect, method=method, min_confidence=threshold, max_planes=getattr(options, "max_planes", None))
    return cast(Detect, finds), threshold  # of arrays: Planes


def _check(options: argparse.Namespace, files: list[Path]) -> None:
    """Refuse what would fail only after minutes of work."""
    if not files:
        raise ValueError("no file to detect on; name one or several, or try --example")
    if options.samples > MOST_SAMPLES:
        raise ValueError(f"--samples {options.samples}: at most {MOST_SAMPLES:,} points are drawn on a mesh")
    if options.json and options.json != "-" and Path(options.json).is_dir():
        raise ValueError(f"--json {options.json} is a folder; name a file")
    if files.count(STDIN) > 1:
        raise ValueError("standard input, -, can be read once; name it once")
    check_outputs(options, files)


def _as_line(path: Path, error: Exception) -> str:
    """The error in one line that names the file."""
    text, kind = " ".join(str(error).split()), type(error).__name__
    if isinstance(error, MemoryError):
        text = "it needs more memory than there is"
    elif not isinstance(error, ValueError | OSError | RuntimeError) or not text:
        text = f"{kind}: {text}" if text else kind  # of no kind that a reader or a method should raise
    name = shown(path)
    text = printable(text if path == STDIN else text.replace(str(path), name))
    return text if name in text else f"{name}: {text}"


def _say(text: str, stream) -> None:
    """Print beside the progress bar, with escapes for what the stream's encoding cannot show."""
    encoding = getattr(stream, "encoding", None) or "utf-8"
    tqdm.write(text.encode(encoding, "backslashreplace").decode(encoding), file=stream)
