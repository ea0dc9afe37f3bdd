"""What `symshrec detect` writes beside its table: pictures, results, deviations, BOP's symmetries."""

import argparse
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from symshrec.cli.outputs import STEM, out_path
from symshrec.files.atomic import write_atomically
from symshrec.geometry.residuals import mirror_deviations
from symshrec.planes import Planes
from symshrec.scans import stem_of
from symshrec.scans.bop import CONTINUOUS, DISCRETE, object_id, update_models_info
from symshrec.scans.report import Detection, printable, shown
from symshrec.scans.writing import write_shape

PLOTS = (".png", ".html")
ONLY_OBJECT = 1  # BOP's ID of an object whose file's name has none


def check_outputs(options: argparse.Namespace, files: list[Path]) -> None:
    """Refuse outputs that cannot be written, before any work is done.

    Raises:
        ValueError: naming the option.
    """
    for name in ("plot", "res", "deviation"):
        out = getattr(options, name)
        if out and len(files) > 1 and STEM not in out:
            raise ValueError(f"--{name} {out} is one file for {len(files)}; put {STEM} into its name")
    if len(files) > 1 and (options.plot or options.res or options.deviation):
        stems = [stem_of(path) for path in files]
        twice = next((stem for stem in stems if stems.count(stem) > 1), None)
        if twice is not None:
            raise ValueError(f"several files are called {twice}; detect on one at a time, or rename one")
    if options.plot and Path(options.plot).suffix.lower() not in PLOTS:
        raise ValueError(f"--plot {options.plot}: unknown extension; draw to {' or '.join(PLOTS)}")
    if options.plot and Path(options.plot).suffix.lower() == ".html" and not find_spec("plotly"):
        raise ValueError("--plot to html needs plotly: pip install 'symshrec[plot]', or draw to .png")
    if options.bop:
        _check_bop(options, files)
    if options.deviation:
        _check_deviation(options.deviation, files)
    if options.res and not options.res.endswith(".txt"):
        raise ValueError(f"--res {options.res}: the track's results are called OUT_res.txt")
    for name in ("plot", "res", "deviation", "bop", "json"):
        out = getattr(options, name)
        if out and out != "-" and STEM not in str(Path(out).parent):  # others with the file that they are of
            out_path(name, out, files[0])


def _check_bop(options: argparse.Namespace, files: list[Path]) -> None:
    if Path(options.bop).suffix.lower() != ".json":
        raise ValueError(f"--bop {options.bop}: unknown extension; BOP's file is called models_info.json")
    if len(files) > 1 and STEM not in options.bop:
        numbers = [object_id(stem_of(path)) for path in files]
        if options.bop_id is not None or None in numbers or len(set(numbers)) < len(files):
            raise ValueError("--bop of several files takes each object's ID from its name, such as obj_000005.ply")


def _check_deviation(out: str, files: list[Path]) -> None:
    if Path(out).suffix.lower() != ".ply":
        raise ValueError(f"--deviation {out}: unknown extension; points with their deviation are written to .ply")
    outs = [Path(out.replace(STEM, stem_of(path))) for path in files]
    if any(each.exists() and path.exists() and each.samefile(path) for each in outs for path in files):
        raise ValueError(f"--deviation {out} is a file that is read; name another one to write")


def _chosen(detection: Detection, number: int) -> Planes:
    """The plane of a number, from 1 on."""
    if number > len(detection.planes):
        raise ValueError(f"--plane {number}: {len(detection.planes)} planes were found, numbered from 1")
    return detection.planes[number - 1]


def _deviations(detection: Detection, planes: Planes) -> np.ndarray:
    """Of the cloud's points from their mirror images, signed: (K, N)."""
    return mirror_deviations(detection.cloud.points, planes, detection.cloud.surface)


def write_outputs(detection: Detection, options: argparse.Namespace) -> list[str]:
    """Write what the options ask for; gives what there is to say of it.

    Raises:
        ValueError: for a plane that was not found, and as `update_models_info`.
    """
    if options.deviation:
        (deviations,) = _deviations(detection, _chosen(detection, options.plane))
        out = out_path("deviation", options.deviation, detection.path)
        write_shape(out, detection.cloud.points, values={"deviation": deviations})
    if options.res:
        from symshrec.benchmark.official import write_results

        write_results(out_path("res", options.res, detection.path), detection.planes)
    if options.plot:
        _plot(detection, out_path("plot", options.plot, detection.path), options)
    return [_bop(detection, options)] if options.bop else []


def _plot(detection: Detection, out: Path, options: argparse.Namespace) -> None:
    from symshrec.reporting.figures.detection import picture
    from symshrec.reporting.figures.subject import MAPPED, Subject

    cloud, planes, mapped = detection.cloud, detection.planes, options.colour == "deviation"
    subject = Subject(cloud.points, planes, cloud.mesh, detection.group)
    if out.suffix.lower() == ".html":
        from symshrec.reporting.figures.page import cloud_page

        deviations = _deviations(detection, planes[:MAPPED]) if mapped else None
        content = cloud_page(subject, shown(Path(detection.path.name)), deviations).encode()
    else:
        if mapped:
            (deviations,) = _deviations(detection, _chosen(detection, options.plane))
            subject = replace(subject, deviations=deviations, number=options.plane)
        content = picture(subject)
    write_atomically(out, content, sync=False)


def _bop(detection: Detection, options: argparse.Namespace) -> str:
    """Write the object's entry, and give a line that says what it holds."""
    cloud, group = detection.cloud, detection.group
    number = options.bop_id if options.bop_id is not None else object_id(stem_of(detection.path))
    number = ONLY_OBJECT if number is None else number
    out = out_path("bop", options.bop, detection.path)
    points = cloud.points if cloud.mesh is None else cloud.mesh.vertices[np.unique(cloud.mesh.triangles)]
    entry = update_models_info(out, number, points, group, options.bop_scale)
    turns, axes = len(entry.get(DISCRETE, [])), len(entry.get(CONTINUOUS, []))
    which = f"{printable(out)}: object {number}"
    if turns or axes:
        found = [f"{turns} discrete symmetr{'ies' if turns > 1 else 'y'}"] * bool(turns) + [
            "an axis of all turns"
        ] * axes
        beside = f"; planes {', '.join(str(row + 1) for row in group.outside)} not used" * bool(group.outside)
        return f"{which} has {' and '.join(found)}{beside}; 1 unit of the file is {options.bop_scale:g} mm"
    why = "no mirror plane was found"
    if len(detection.planes) == 1:
        why = "a mirror is no proper rotation, which alone BOP knows, and it takes two planes to make one"
    elif len(detection.planes):
        why = f"its {len(detection.planes)} planes make no group"
    return f"{which} has no symmetries: {why}"
