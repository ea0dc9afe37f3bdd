"""Figure 2's gallery of families, §2.2's perturbations and ours, and the curves behind the tables, as PNG files."""

import io
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from symshrec.benchmark.cloud import (
    FAMILIES,
    HARD_PERTURBATIONS,
    PLANELESS,
    PLANELESS_SOLIDS,
    PUBLISHED_PERTURBATIONS,
    SCAN_PERTURBATIONS,
    SOLIDS,
    LabelledCloud,
)
from symshrec.benchmark.config import (
    BenchmarkConfig,
    HardConfig,
    NoiseConfig,
    PoseConfig,
    PoseGroup,
    ScanConfig,
    SplitConfig,
    SurfaceConfig,
)
from symshrec.benchmark.generate import generate_cloud
from symshrec.files.atomic import write_atomically
from symshrec.reporting.figures.drawing import View, draw_cloud
from symshrec.reporting.figures.reliability import Reliability, reliability
from symshrec.reporting.tables.compared import Compared
from symshrec.reporting.tables.results import EPSILON, THETA_DEG
from symshrec.reporting.tables.sweep import sweep_curves, swept

DASHES = ("-", "--", ":")
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000")  # Okabe and Ito
RECALLS = np.linspace(0, 1, 11)
WHAT = {
    "P0": "clean",
    "P1": "uniform noise",
    "P2": "Gaussian noise",
    "P3": "undersampled",
    "P4": "P1 then P3",
    "P5": "P2 then P3",
    "P6": "partial",
    "P7": "strong noise",
    "P8": "outliers",
    "P9": "few points",
    "P10": "uneven density",
    "P11": "one-sided scanner",
    "P12": "single view",
    "P13": "cut or bite",
    "P14": "floor",
    "P15": "nearly symmetric",
}


def make_figures(folder: Path) -> list[Path]:
    """Write gallery, planeless, perturbations, hard and scan .png, always the same, from clouds made on the spot."""
    figures = {
        "gallery.png": gallery(),
        "planeless.png": planeless(),
        "perturbations.png": perturbations(PUBLISHED_PERTURBATIONS),
        "hard.png": perturbations(HARD_PERTURBATIONS),
        "scan.png": perturbations(SCAN_PERTURBATIONS),
    }
    return [save_figure(figure, Path(folder) / name) for name, figure in figures.items()]


def make_result_figures(results: Sequence[dict], folder: Path, compared: Sequence[Compared] = ()) -> list[Path]:
    """Write precision_recall.png, sweep.png where a result holds a sweep, reliability.png where runs are compared.

    Args:
        results: as for the tables. compared: predictions beside the truth, of any runs.
    """
    figures = {}
    if any("precision_recall" in result for result in results):
        figures["precision_recall.png"] = precision_recall_figure(results)
    if several := swept(results):
        figures["sweep.png"] = sweep_figure(several)
    if compared:
        figures["reliability.png"] = reliability_figure([reliability(run) for run in compared])
    return [save_figure(figure, Path(folder) / name) for name, figure in figures.items()]


def gallery_clouds(solid: str, seed: int = 2023) -> list[LabelledCloud]:
    """A clean, upright cylinder or cone of every family, in Table 4's order."""
    config = BenchmarkConfig(
        seed=seed,
        surface=SurfaceConfig(cylinder_probability=float(solid == "cylinder"), height=[1.5, 1.5]),
        pose=PoseConfig(group=PoseGroup.none),
        splits={"gallery": SplitConfig(len(FAMILIES), perturbations={"P0": len(FAMILIES)})},
    )
    clouds = [generate_cloud(config, "gallery", index) for index in range(len(FAMILIES))]
    return sorted(clouds, key=lambda cloud: FAMILIES.index(cloud.labels.family))


def gallery(seed: int = 2023) -> Figure:
    """Seven families, as cylinder and as cone, with all their true planes."""
    figure = Figure(figsize=(15, 5.1))
    figure.subplots_adjust(0, 0, 1, 0.92, wspace=0.03, hspace=0.13)
    axes = figure.subplots(len(SOLIDS), len(FAMILIES))
    for row, solid in zip(axes, SOLIDS, strict=True):
        for number, (ax, cloud) in enumerate(zip(row, gallery_clouds(solid, seed), strict=True), 1):
            name = f"S{number} {cloud.labels.family.replace('_', ' ')}\n" if solid == SOLIDS[0] else ""
            count = len(cloud.planes or ())
            title = f"{name}{solid}: {count} plane{'s' if count > 1 else ''}"
            draw_cloud(ax, cloud.points, cloud.planes, title=title)
    return figure


def planeless(seed: int = 2023, each: int = 2) -> Figure:
    """Shapes without a mirror plane, `each` of every kind."""
    split = SplitConfig(16, perturbations={"P0": 16}, families={PLANELESS: 16})
    config = BenchmarkConfig(seed=seed, pose=PoseConfig(group=PoseGroup.none), splits={"planeless": split})
    clouds = [generate_cloud(config, "planeless", index) for index in range(split.clouds)]
    shown = [cloud for kind in PLANELESS_SOLIDS for cloud in [c for c in clouds if c.labels.solid == kind][:each]]
    figure = Figure(figsize=(2.5 * len(shown), 2.8))
    figure.subplots_adjust(0, 0, 1, 0.9, wspace=0.12)
    for ax, cloud in zip(figure.subplots(1, len(shown)), shown, strict=True):
        draw_cloud(ax, cloud.points, title=cloud.labels.solid, limit=6400, size=1.5)
    return figure


def perturbed_clouds(names: Sequence[str], family: str = "astroid", seed: int = 2023) -> list[LabelledCloud]:
    """One upright cylinder under the named perturbations: the same surface points, differently disturbed."""
    hard = HardConfig(cut_fraction=[0.3, 0.3], strong_n=[7], outlier_fraction=[0.2, 0.2], few_points=[512, 512])
    scan = ScanConfig(
        [10.0] * 2, 0.0, bite_probability=0.0, cut_fraction=[0.25] * 2, floor_width=[2.0] * 2, bend=[0.04] * 2
    )
    noise = NoiseConfig([0.6] * 2, [0.6] * 2, uniform_n=[15], gaussian_n=[20], hard=hard, scan=scan)
    base = BenchmarkConfig(
        seed=seed,
        surface=SurfaceConfig(cylinder_probability=1.0, height=[1.5, 1.5]),
        pose=PoseConfig(group=PoseGroup.none),
        noise=noise,
    )
    splits = {name: SplitConfig(1, perturbations={name: 1}, families={family: 1}) for name in names}
    return [generate_cloud(replace(base, splits={"one": split}), "one", 0) for split in splits.values()]


def perturbations(names: Sequence[str], seed: int = 2023) -> Figure:
    """One shape under the named perturbations, with its true planes."""
    figure = Figure(figsize=(2.5 * len(names), 3.0))
    figure.subplots_adjust(0, 0, 1, 0.86, wspace=0.03)
    for ax, cloud in zip(figure.subplots(1, len(names)), perturbed_clouds(names, seed=seed), strict=True):
        name = cloud.labels.perturbation
        title = f"{name}: {WHAT[name]}\n{len(cloud.points):,} points"
        draw_cloud(ax, cloud.points, cloud.planes, title=title, view=View(28, 58), limit=6400, size=1.5)
    return figure


def draw_precision_recall(ax: Axes, curves: Mapping[str, Sequence[float] | np.ndarray]) -> None:
    """Interpolated precision at recall 0, 0.1 … 1, each curve (11,) labelled by its name."""
    for (name, precision), style in zip(curves.items(), _styles(len(curves)), strict=True):
        ax.plot(RECALLS, precision, **style, marker="o", markersize=3.5, label=name)
    ax.set(xlabel="recall", ylabel="precision", xlim=(-0.01, 1.01), ylim=(0, 1.02))
    _finish(ax)


def precision_recall_figure(results: Sequence[dict]) -> Figure:
    """The mean precision-recall curve of every result at θ = 1°, ε = 1%."""
    curves = {}
    for result in results:
        for curve in result.get("precision_recall", []):
            if np.allclose([curve["theta_deg"], curve["epsilon"]], [THETA_DEG, EPSILON]):
                curves[result["name"]] = curve["precision"]
    figure = Figure(figsize=(7.6, 4.4), layout="constrained")
    ax = figure.subplots()
    draw_precision_recall(ax, curves)
    _legend_beside(ax)
    ax.set_title("Precision and recall at θ = 1°, ε = 1%", fontsize=11)
    return figure


def sweep_figure(results: Sequence[dict]) -> Figure:
    """mAP (solid) and recall-aware mAP (dashed) over θ at fixed ε, and over ε at fixed θ, for every result."""
    figure = Figure(figsize=(9.6, 4.0), layout="constrained")
    panels = dict(zip(("theta", "epsilon"), figure.subplots(1, 2, sharey=True), strict=True))
    for result, colour in zip(results, _colours(len(results)), strict=True):
        for metric, style in (("mAP", "-"), ("recall_aware_mAP", "--")):
            for along, (places, values, _) in sweep_curves(result, metric).items():
                label = result["name"] if style == "-" else None
                scaled = np.multiply(places, 1 if along == "theta" else 100)
                panels[along].plot(scaled, np.array(values, dtype=float), style, color=colour, label=label)
    panels["theta"].set(xlabel="angular tolerance θ in degrees, at ε = 1%", ylabel="score", ylim=(0, 1.02))
    panels["epsilon"].set(xlabel="distance tolerance ε in % of the diagonal, at θ = 1°")
    for ax, paper in zip(panels.values(), (THETA_DEG, 100 * EPSILON), strict=True):
        ax.axvline(paper, color="#999999", linewidth=0.8, linestyle=":")
        ax.set_xscale("log")
        ax.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
        _finish(ax)
    figure.suptitle("mAP (solid) and recall-aware mAP (dashed); dotted: the paper's tolerance", fontsize=11)
    return figure


def reliability_figure(runs: Sequence[Reliability]) -> Figure:
    """Share of right planes over confidence for every run, and below it how many planes there are."""
    figure = Figure(figsize=(8.2, 5.6), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    above.plot([0, 1], [0, 1], color="#999999", linewidth=0.8, linestyle=":")
    for run, style in zip(runs, _styles(len(runs)), strict=True):
        filled = run.counts > 0
        label = f"{run.name} (mean gap {run.error:.3f})"
        above.plot(run.confidences[filled], run.correct[filled], **style, marker="o", markersize=4, label=label)
        below.stairs(run.counts, np.linspace(0, 1, len(run.counts) + 1), **style)
    above.set(ylabel="share of right planes", xlim=(-0.01, 1.01), ylim=(-0.01, 1.02))
    above.set_title(f"Right at θ = {THETA_DEG:g}°, ε = {100 * EPSILON:g}%; dotted: as confident as right", fontsize=11)
    below.set(xlabel="confidence", ylabel="planes", yscale="symlog")
    for ax in (above, below):
        _finish(ax)
    _legend_beside(above)
    return figure


def _colours(count: int) -> list[str]:
    return [COLOURS[i % len(COLOURS)] for i in range(count)]


def _styles(count: int) -> list[dict[str, Any]]:
    """A colour each, and another dash once the colours begin again."""
    return [{"color": colour, "linestyle": DASHES[i // len(COLOURS) % 3]} for i, colour in enumerate(_colours(count))]


def _legend_beside(ax: Axes) -> None:
    """Where many curves leave no room between them."""
    ax.legend(frameon=False, fontsize=9, loc="upper left", bbox_to_anchor=(1.0, 1.0))


def _finish(ax: Axes) -> None:
    ax.grid(color="#e5e5e5", linewidth=0.8)
    ax.spines[["top", "right"]].set_visible(False)
    if ax.get_legend_handles_labels()[0]:
        ax.legend(frameon=False, fontsize=9)


def save_figure(figure: Figure, path: Path, dpi: int = 110, colours: int = 192) -> Path:
    """Write a figure as PNG with a palette of `colours`, a third of the plain size; replaced in one step."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    buffer = io.BytesIO()
    FigureCanvasAgg(figure)
    figure.savefig(buffer, format="png", dpi=dpi)
    image = Image.open(buffer).convert("RGB").quantize(colours, dither=Image.Dither.NONE)
    packed = io.BytesIO()
    image.save(packed, format="png", optimize=True)
    write_atomically(path, packed.getvalue(), sync=False)
    return path
