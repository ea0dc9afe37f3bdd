"""results/figures/real.png: objects as scanners see them, with the planes that a method claims."""

from collections.abc import Sequence
from io import BytesIO
from pathlib import Path

from matplotlib.figure import Figure

from experiments.real_objects.conditions import CONDITIONS, make
from experiments.real_objects.objects import load
from experiments.real_objects.scores import SURE
from experiments.real_objects.study import stored
from symshrec.files.atomic import write_atomically
from symshrec.reporting.figures.drawing import draw_cloud

SHOWN = (
    ("airplane", "view_oblique"),
    ("lego", "floor_2"),
    ("walker_body", "scanner"),
    ("nut", "gradient_10"),
    ("shelf", "cut_20"),
    ("gripper_finger", "bite_10"),
)


def draw(objects: Sequence[dict], folder: Path, packages: Path, path: Path, method: str) -> None:
    """Each pair of SHOWN that the method has a row of, upright, with its claimed planes (vermilion)."""
    named = {each["name"]: each for each in objects}
    rows = {(row.object, row.condition): row for row in stored(folder, method)}
    shown = [pair for pair in SHOWN if pair in rows and pair[0] in named]
    if not shown:
        return
    figure, content = Figure((3.2 * len(shown[:3]), 3.5 * -(-len(shown) // 3)), layout="constrained"), BytesIO()
    axes = figure.subplots(-(-len(shown) // 3), len(shown[:3]), squeeze=False).ravel()
    for ax in axes[len(shown) :]:
        ax.set_axis_off()
    for ax, pair in zip(axes, shown, strict=False):
        shape, (name, condition) = load(named[pair[0]], packages), pair
        cloud = make(shape.surface, shape.planes, shape.nearly, name, condition)
        planes = rows[pair].planes.transformed(cloud.turn.T)
        title = f"{name.replace('_', ' ')}, {CONDITIONS[condition].title}"
        draw_cloud(ax, cloud.points @ cloud.turn, predicted=planes[planes.confidences >= SURE], title=title, size=1.4)
        ax.title.set_fontsize(9)
    figure.savefig(content, format="png", dpi=110, metadata={"Software": None})
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, content.getvalue())
