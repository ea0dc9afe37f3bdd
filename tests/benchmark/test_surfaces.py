"""True planes of generated clouds are the mirror planes of the surface, wherever the pose puts it."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from symshrec.benchmark.cloud import FAMILIES, SOLIDS
from symshrec.benchmark.config import BenchmarkConfig, PoseConfig, PoseGroup, SplitConfig, SurfaceConfig, UnitScaling
from symshrec.benchmark.curves import draw_curve
from symshrec.benchmark.generate import SHAPE, generate_cloud
from symshrec.benchmark.randomness import generator
from symshrec.benchmark.surfaces import draw_shape
from symshrec.planes import Planes

DENSE = 20_000
TOLERANCE = 4e-3


def clean_config(family, solid, group=PoseGroup.so3):
    surface = SurfaceConfig(cylinder_probability=float(solid == "cylinder"))
    splits = {"train": SplitConfig(3, {"P0": 3}, {family: 3})}
    return BenchmarkConfig(surface=surface, pose=PoseConfig(group), splits=splits)


def distance_to_surface(points, cloud, config):
    """Distance of world points (..., 3) from the cloud's surface at their own height; infinite above and below it."""
    labels = cloud.labels
    curve = draw_curve(labels.family, generator(config.seed, "train", cloud.id, SHAPE), config.curves)
    low, high = curve.domain
    section = curve.points(low + (high - low) * np.arange(DENSE) / DENSE)
    tree = cKDTree(section / section.max())
    local = (points.astype(np.float64) - labels.translation) @ labels.rotation
    height = labels.parameters["height"]
    share = local[..., 2] / height + 0.5
    width = share if labels.solid == "cone" else np.ones_like(share)
    inside = (share > -1e-5) & (share < 1 + 1e-5)
    usable = inside & (width > 0.1)
    scaled = np.where(usable[..., None], local[..., :2] / np.where(usable, width, 1.0)[..., None], section[0])
    far = tree.query(scaled)[0]
    return np.where(inside, np.where(usable, far, 0.0), np.inf)


@pytest.mark.parametrize("solid", SOLIDS)
@pytest.mark.parametrize("family", FAMILIES)
def test_mirroring_across_every_true_plane_gives_the_same_surface(family, solid):
    config = clean_config(family, solid)
    for index in range(3):
        cloud = generate_cloud(config, "train", index)
        points = cloud.points[::8]
        assert distance_to_surface(points, cloud, config).max() < TOLERANCE
        assert distance_to_surface(cloud.planes.mirror(points), cloud, config).max() < TOLERANCE
        rotation, translation = cloud.labels.rotation, cloud.labels.translation
        middle = Planes(rotation[:, 2:].T, translation[None])
        if solid == "cone":
            assert distance_to_surface(middle.mirror(points), cloud, config).max() > 0.1
        lines = len(cloud.planes) - (solid == "cylinder")
        between = np.pi / lines * (np.arange(lines) + 0.5)
        normals = np.stack([-np.sin(between), np.cos(between), 0 * between], axis=1) @ rotation.T
        false = Planes(normals, np.tile(translation, (lines, 1)))
        assert (distance_to_surface(false.mirror(points), cloud, config).max(axis=1) > 0.02).all()


@pytest.mark.parametrize("solid", SOLIDS)
@pytest.mark.parametrize("family", FAMILIES)
def test_normals_are_across_the_surface(family, solid):
    config = clean_config(family, solid)
    shape = draw_shape(family, np.random.default_rng(2), config)
    chart, rng = shape.chart[:400], np.random.default_rng(3)
    moved = chart + 1e-4 * np.c_[rng.normal(size=(400, 2)), np.zeros(400)]
    low, high = shape.surface.curve.domain
    inside = (chart[:, 1] > 0.01) & (chart[:, 1] < 0.99) & (chart[:, 0] > low + 0.01) & (chart[:, 0] < high - 0.01)
    tangents = (shape.surface.points(moved) - shape.surface.points(chart))[inside]
    normals = shape.surface.normals(chart)[inside]
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1)
    lean = np.abs((tangents * normals).sum(axis=1)) / np.linalg.norm(tangents, axis=1)
    assert np.median(lean) < 1e-3
    assert np.quantile(lean, 0.95) < 0.05


@pytest.mark.parametrize("solid", SOLIDS)
@pytest.mark.parametrize("family", FAMILIES)
def test_the_points_of_a_shape_are_the_surface_where_its_chart_says(family, solid):
    config = clean_config(family, solid)
    shape = draw_shape(family, np.random.default_rng(2), config)
    u, shares, branch = shape.chart.T
    section = shape.surface.curve.at(u, branch)
    heights = shape.surface.height * shares - shape.surface.height / 2
    plain = np.column_stack([section if solid == "cylinder" else section * shares[:, None], heights])
    np.testing.assert_array_equal(shape.points, plain)
    np.testing.assert_array_equal(shape.surface.points(shape.chart), plain)
    assert shape.unit_factor == 1 / section.max()
    with pytest.raises(ValueError, match="read-only"):  # other shapes have the same planes
        shape.planes.normals[0] = 0


@pytest.mark.parametrize("solid", SOLIDS)
def test_number_of_planes_is_lines_and_one_for_the_cylinder(solid):
    for family in FAMILIES:
        config = clean_config(family, solid)
        cloud = generate_cloud(config, "train", 0)
        curve = draw_curve(family, generator(config.seed, "train", 0, SHAPE), config.curves)
        assert len(cloud.planes) == len(curve.mirror_angles) + (solid == "cylinder")
        np.testing.assert_array_equal(cloud.planes.points, np.tile(cloud.labels.translation, (len(cloud.planes), 1)))


def test_unit_size_heights_and_uniform_extrusion():
    config = clean_config("mouth_curve", "cone", PoseGroup.none)
    for index in range(3):
        points = generate_cloud(config, "train", index).points.astype(np.float64)
        height = generate_cloud(config, "train", index).labels.parameters["height"]
        share = points[:, 2] / height + 0.5
        assert 0.5 <= height <= 4.0
        assert len(points) == 6400
        assert (points[:, :2] / share[:, None])[share > 0.01].max() == pytest.approx(1, abs=1e-5)
        assert np.abs(np.sort(share) - (np.arange(6400) + 0.5) / 6400).max() * 80 < 1.95
    assert len(generate_cloud(clean_config("citrus", "cone"), "train", 0).points) == 12800


def test_pose_moves_planes_with_points():
    for group in (PoseGroup.track, PoseGroup.so3):
        still = generate_cloud(clean_config("astroid", "cylinder", PoseGroup.none), "train", 1)
        moved = generate_cloud(clean_config("astroid", "cylinder", group), "train", 1)
        rotation, translation = moved.labels.rotation, moved.labels.translation
        np.testing.assert_allclose(moved.points, still.points @ rotation.T + translation, atol=1e-5)
        np.testing.assert_allclose(moved.planes.normals, still.planes.normals @ rotation.T, atol=1e-12)


def test_unit_scaling_before_or_after_the_noise_or_never():
    clouds = {}
    for scaling in UnitScaling:
        config = clean_config("egg_keplero", "cylinder", PoseGroup.none)
        config.surface.unit_scaling = scaling
        clouds[scaling] = generate_cloud(config, "train", 0).points
        config.splits["train"] = SplitConfig(3, {"P1": 3}, {"egg_keplero": 3})
        moved = generate_cloud(config, "train", 0)
        largest = np.abs(moved.points - clouds[scaling]).max(axis=0) * moved.labels.parameters["noise_n"]
        np.testing.assert_allclose(largest, [2, 2, 1] if scaling is UnitScaling.after_noise else [1, 1, 1], rtol=0.01)
    np.testing.assert_array_equal(clouds[UnitScaling.before_noise], clouds[UnitScaling.after_noise])
    np.testing.assert_allclose(
        clouds[UnitScaling.before_noise] / clouds[UnitScaling.never], np.tile([2, 2, 1], (6400, 1)), rtol=1e-3
    )
