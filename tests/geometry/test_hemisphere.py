"""Directions of a hemisphere are one for every plane, and evenly spread."""

import numpy as np
import pytest

from symshrec.geometry.hemisphere import hemisphere_directions


@pytest.mark.parametrize("count", [27, 400, 1500])
def test_every_plane_has_a_direction_near_it_and_none_has_two(count):
    directions = hemisphere_directions(count)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1, atol=1e-15)
    assert (directions[:, 2] > 0).all()
    spacing = np.sqrt(2 * np.pi / count)  # side of a direction's share of the half sphere
    normals = np.random.default_rng(0).normal(size=(5000, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    assert np.arccos(np.abs(normals @ directions.T).max(1).clip(max=1)).max() < 1.1 * spacing
    among = directions @ directions.T
    np.fill_diagonal(among, -1)
    assert np.arccos(among.max()) > 0.7 * spacing


def test_none_is_refused():
    with pytest.raises(ValueError, match="at least one"):
        hemisphere_directions(0)
