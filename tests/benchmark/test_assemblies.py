"""Objects put together of parts: on their own surface, and symmetric about the planes that they say."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from symshrec.benchmark.assemblies import SOLIDS, Assembly, Part, draw_assembly


@pytest.mark.parametrize("name", SOLIDS)
def test_the_area_of_a_solid_is_that_of_its_points(name):
    """By the divergence theorem a solid's volume is a third of the mean of x · n on its surface, times its area."""
    rng = np.random.default_rng(0)
    half = np.array([1.0, 1.0, 0.3]) if name == "torus" else np.array([1.0, 0.7, 0.5])
    points, normals = SOLIDS[name].draw(100_000, half, rng)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1)
    assert not SOLIDS[name].inside(points + 1e-6 * normals, half).any()
    assert SOLIDS[name].inside(points - 1e-6 * normals, half).mean() > 0.999
    volume = 8 * SOLIDS[name].inside(rng.uniform(-1, 1, (400_000, 3)), half).mean()
    assert SOLIDS[name].area(half) == pytest.approx(3 * volume / (points * normals).sum(1).mean(), rel=0.02)


def test_what_lies_inside_another_part_is_no_surface():
    rng = np.random.default_rng(1)
    parts = [Part(SOLIDS["box"], np.ones(3), np.eye(3), np.array([x, 0.0, 0.0])) for x in (-0.5, 0.5)]
    points = Assembly(parts).points(Assembly(parts).draw(4000, rng))
    assert len(points) == 4000
    np.testing.assert_allclose(np.abs(points / [1.5, 1, 1]).max(1), 1)
    assert np.ptp(points[:, 0]) == pytest.approx(3)


def test_objects_are_symmetric_about_their_planes():
    counts = set()
    for seed in range(24):
        rng = np.random.default_rng(seed)
        surface, planes = draw_assembly(rng)
        counts.add(len(planes))
        dense = cKDTree(surface.points(surface.draw(20_000, rng)))
        some = surface.points(surface.draw(500, rng))
        own = np.quantile(dense.query(some)[0], 0.98)
        for images in planes.mirror(some):
            assert np.quantile(dense.query(images)[0], 0.95) < 1.5 * own
    assert counts == {0, 1, 2}
