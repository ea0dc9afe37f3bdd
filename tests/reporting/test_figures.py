import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

from symshrec.benchmark.cloud import FAMILIES, PERTURBATIONS
from symshrec.reporting.figures.figures import (
    gallery_clouds,
    make_figures,
    make_result_figures,
    perturbed_clouds,
    precision_recall_figure,
    save_figure,
)


def a_result(name, tolerances):
    scores = [
        {"metric": m, "group": "all", "theta_deg": t, "epsilon": e, "value": t / (t + 1), "clouds": 5}
        for m in ("mAP", "recall_aware_mAP")
        for t, e in tolerances
    ]
    curves = [{"theta_deg": t, "epsilon": e, "precision": [t / (t + 1)] * 11} for t, e in tolerances]
    return {"name": name, "scores": scores, "precision_recall": curves}


def test_gallery_and_perturbations_are_images_of_moderate_size(tmp_path):
    paths = make_figures(tmp_path / "figures")
    assert [path.name for path in paths] == [
        "gallery.png",
        "planeless.png",
        "perturbations.png",
        "hard.png",
        "scan.png",
    ]
    assert sorted(tmp_path.joinpath("figures").iterdir()) == sorted(paths)
    for path in paths:
        pixels = np.asarray(Image.open(path).convert("L"))
        assert pixels.shape[1] > 1000
        assert (pixels < 128).mean() > 0.005
        assert path.stat().st_size < 400_000


@pytest.mark.parametrize(("solid", "mid_planes"), [("cylinder", 1), ("cone", 0)])
def test_gallery_shows_every_family_clean(solid, mid_planes):
    clouds = gallery_clouds(solid)
    assert [cloud.labels.family for cloud in clouds] == list(FAMILIES)
    assert {(cloud.labels.solid, cloud.labels.perturbation) for cloud in clouds} == {(solid, "P0")}
    assert len(clouds[0].planes) == 4 + mid_planes


def test_perturbations_are_of_one_shape():
    clouds = perturbed_clouds(PERTURBATIONS)
    assert [cloud.labels.perturbation for cloud in clouds] == list(PERTURBATIONS)
    for cloud in clouds[1:15]:
        np.testing.assert_array_equal(cloud.planes.normals, clouds[0].planes.normals)
    clean = {tuple(point) for point in clouds[0].points}
    assert {tuple(point) for point in clouds[3].points} < clean
    for noisy in clouds[1:3]:
        assert sum(tuple(point) in clean for point in noisy.points) == round(0.4 * len(clean))
    for fewer in (clouds[6], clouds[9]):
        assert {tuple(point) for point in fewer.points} < clean
    assert {tuple(point) for point in clouds[8].points} > clean
    for fewer in clouds[12:14]:
        assert {tuple(point) for point in fewer.points} < clean
    assert len(clouds[15].planes) == 1


def test_result_figures_follow_what_was_measured(tmp_path):
    single, sweep = [(1.0, 0.01)], [(t, e) for t in (0.5, 1.0, 2.0) for e in (0.005, 0.01)]
    assert [p.name for p in make_result_figures([a_result("M4", single)], tmp_path)] == ["precision_recall.png"]
    both = make_result_figures([a_result("M4", sweep), a_result("M3 (R1)", single)], tmp_path)
    assert [p.name for p in both] == ["precision_recall.png", "sweep.png"]
    (ax,) = precision_recall_figure([a_result("M4", sweep)]).axes
    np.testing.assert_allclose(ax.lines[0].get_ydata(), 0.5)


def test_saving_replaces_the_file_and_leaves_no_other(tmp_path):
    path = tmp_path / "deep" / "a.png"
    for size in (2, 3):
        save_figure(Figure(figsize=(size, size)), path, dpi=50)
        assert Image.open(path).size == (50 * size, 50 * size)
    assert list(path.parent.iterdir()) == [path]
