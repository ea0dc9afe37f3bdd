"""Shapes without a mirror plane: no plane fits them, and their empty truth passes through everything."""

import math

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.spatial import cKDTree

from symshrec.benchmark.cloud import PLANELESS_SOLIDS
from symshrec.benchmark.config import BenchmarkConfig, SplitConfig, SurfaceConfig
from symshrec.benchmark.generate import generate_cloud, generate_dataset
from symshrec.benchmark.official import read_planes, write_track
from symshrec.benchmark.planeless import KINDS
from symshrec.benchmark.randomness import generator
from symshrec.benchmark.shards import ShardedSplit
from symshrec.benchmark.surfaces import draw_shape
from symshrec.data.datamodule import SymmetryDataModule
from symshrec.data.settings import DataSettings
from symshrec.metrics.torchmetric import SymmetryMetric
from symshrec.planes import Planes

DIRECTIONS = 200


def least_misfit(points):
    """Mean distance of mirrored points from the cloud over the best plane there is, in distances between neighbours."""
    tree, some, centre = cKDTree(points), points[::10], points.mean(axis=0)
    k = np.arange(DIRECTIONS) + 0.5
    z, turn = k / DIRECTIONS, np.pi * (1 + 5**0.5) * k
    directions = np.c_[np.sqrt(1 - z * z) * np.cos(turn), np.sqrt(1 - z * z) * np.sin(turn), z]

    def misfit(plane):
        normal = plane[:3] / np.linalg.norm(plane[:3])
        return tree.query(some - 2 * ((some - centre) @ normal - plane[3])[:, None] * normal)[0].mean()

    planes = np.c_[directions, np.zeros(DIRECTIONS)]
    best = planes[np.argsort([misfit(plane) for plane in planes])[:4]]
    simplex = np.vstack([np.zeros(4), 0.1 * np.eye(4)])
    found = [minimize(misfit, b, method="Nelder-Mead", options={"initial_simplex": b + simplex}).fun for b in best]
    return min(found) / np.median(tree.query(points, [2])[0])


def test_no_plane_fits_where_a_symmetric_shape_has_one():
    config = BenchmarkConfig()
    shape = draw_shape("astroid", np.random.default_rng(0), config)
    assert least_misfit(shape.surface.points(shape.chart[:3000])) < 1.25
    for kind, draw in KINDS.items():
        rng = generator(3, kind)
        surface, parameters = draw(rng, config)
        assert least_misfit(surface.points(surface.draw(3000, rng))) > 1.4, (kind, parameters)


def test_a_blob_is_the_same_on_all_processors():
    """NumPy's exponential has other last digits where there is AVX-512, and P11 keeps those of the cloud's centre."""
    blob, _ = KINDS["blob"](generator(3, "blob"), BenchmarkConfig())
    chart = blob.draw(500, generator(4, "blob"))
    across = np.sqrt(1 - chart[:, 1] ** 2)
    directions = np.stack([across * np.cos(chart[:, 0]), across * np.sin(chart[:, 0]), chart[:, 1]], axis=1)
    powers = (np.einsum("nd,kd->nk", directions, blob.centres) - 1) / blob.widths**2
    bumps = blob.heights * np.reshape([math.exp(each) for each in powers.flat], powers.shape)
    radii = np.array([math.exp(each) for each in bumps.sum(axis=1)])
    assert np.array_equal(blob.points(chart), radii[:, None] * directions)


def test_they_come_only_where_a_split_names_them():
    config = BenchmarkConfig(splits={"test": SplitConfig(30, {"P0": 30}, {"planeless": 30})})
    clouds = [generate_cloud(config, "test", index) for index in range(30)]
    assert {cloud.labels.solid for cloud in clouds} == set(PLANELESS_SOLIDS)
    assert all(len(cloud.planes) == 0 and len(cloud.points) == 6400 for cloud in clouds)
    config.splits["test"] = SplitConfig(42)
    assert all(generate_cloud(config, "test", index).labels.family != "planeless" for index in range(42))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    root = tmp_path_factory.mktemp("planeless")
    perturbations = {"P1": 4, "P10": 2, "P12": 2, "P13": 2, "P14": 2, "P15": 2}
    config = BenchmarkConfig(
        surface=SurfaceConfig(points=400, citrus_points=400),
        splits={
            "train": SplitConfig(14, perturbations, {"planeless": 7, "astroid": 7}),
            "test": SplitConfig(14, perturbations, {"planeless": 14}),
        },
        clouds_per_shard=7,
    )
    generate_dataset(config, root, progress=False)
    return root


def test_no_plane_passes_through_shards_and_text_files(folder, tmp_path):
    split = ShardedSplit(folder, "test")
    assert split.manifest.splits["test"].max_planes == 0
    assert set(split.families) == {"planeless"}
    assert {len(cloud.planes) for cloud in split} == {0}
    write_track([split[0]], tmp_path)
    (path,) = tmp_path.rglob("points0_sym.txt")
    assert path.read_text() == "0\n"
    assert len(read_planes(path)) == 0


def test_no_plane_passes_through_the_datamodule_and_is_scored(folder):
    data = SymmetryDataModule(DataSettings(root=str(folder), batch_size=14, families=["planeless"]))
    data.setup("test")
    (batch,) = data.test_dataloader()
    metric = SymmetryMetric(count_threshold=0.5)
    wrong = [Planes.empty() if row % 2 else Planes([[1.0, 0, 0]], [[0.0, 0, 0]]) for row in range(14)]
    metric.update(wrong, batch.truth, batch.diagonals, batch.labels, batch.positions)
    scores = {name: float(value) for name, value in metric.compute().items()}
    assert (scores["mAP"], scores["PHC"], scores["count_accuracy"]) == (0, 0, 0.5)
    _, labels, _ = metric.evaluation()
    assert {each.family for each in labels} == {"planeless"}
