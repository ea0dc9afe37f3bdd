import numpy as np
import pytest
from matplotlib.figure import Figure

from symshrec.planes import Planes
from symshrec.reporting.figures.drawing import View, clip_plane, draw_cloud


def random_planes(rng, count):
    return Planes(rng.normal(size=(count, 3)), rng.uniform(-0.5, 0.5, (count, 3)))


def test_clipped_plane_is_the_section_of_the_box():
    rng = np.random.default_rng(1)
    bounds = np.array([[-1.0, -2, -0.5], [1.5, 1, 2]])
    planes = random_planes(rng, 50)
    for normal, point in zip(planes.normals, planes.points, strict=True):
        polygon = clip_plane(normal, point, bounds)
        assert 3 <= len(polygon) <= 6
        np.testing.assert_allclose((polygon - point) @ normal, 0, atol=1e-12)
        on_surface = np.isclose(polygon, bounds[0]) | np.isclose(polygon, bounds[1])
        assert on_surface.any(axis=1).all()
        assert ((polygon >= bounds[0] - 1e-12) & (polygon <= bounds[1] + 1e-12)).all()
        edges = np.roll(polygon, -1, axis=0) - polygon
        turns = np.cross(edges, np.roll(edges, -1, axis=0)) @ normal
        assert (turns > -1e-12).all() or (turns < 1e-12).all()  # convex, in order


def test_plane_outside_the_box_gives_no_polygon():
    assert clip_plane(np.array([0.0, 0, 1]), np.array([0.0, 0, 3]), np.array([[-1.0] * 3, [1.0] * 3])).shape == (0, 3)


def test_axis_aligned_section_is_the_rectangle():
    polygon = clip_plane(np.array([0.0, 0, 1]), np.zeros(3), np.array([[-1.0, -2, -1], [1.0, 2, 1]]))
    assert sorted(map(tuple, polygon)) == [(-1, -2, 0), (-1, 2, 0), (1, -2, 0), (1, 2, 0)]


def test_view_is_a_rotation_with_z_up():
    axes = View(70, 20).axes
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1)
    assert axes[1, 2] > 0
    np.testing.assert_allclose(View(0, 90).axes[2], [0, 0, 1], atol=1e-12)


def test_points_behind_a_plane_take_its_colour():
    points = np.array([[x, y, z] for x in (-1.0, 1) for y in (-1.0, 1) for z in (-1.0, 1)])
    ax = Figure().subplots()
    draw_cloud(ax, points, Planes([[0, 0, 1]], [[0, 0, 0]]), view=View(0, 90))
    colours = ax.collections[-1].get_facecolors()
    below, above = colours[:4], colours[4:]  # drawn from the farthest to the nearest
    assert (below[:, 2] - below[:, 0]).min() > (above[:, 2] - above[:, 0]).max() + 0.1
    assert len(ax.collections) == 2


def test_cloud_is_drawn_without_planes_and_limited():
    ax = Figure().subplots()
    draw_cloud(ax, np.random.default_rng(0).normal(size=(500, 3)), Planes.empty(), None, limit=100)
    assert [len(each.get_offsets()) for each in ax.collections] == [100]
    draw_cloud(ax, np.ones((1, 3)))


@pytest.mark.parametrize("shape", [(0, 3), (5, 2), (3,)])
def test_what_is_no_cloud_is_refused(shape):
    with pytest.raises(ValueError, match=r"shape \(N, 3\)"):
        draw_cloud(Figure().subplots(), np.zeros(shape))
