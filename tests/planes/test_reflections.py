"""The groups' tables against matrices that know nothing of them: all that take a solid's corners to its corners."""

from itertools import permutations

import numpy as np
import pytest
import trimesh

from symshrec.planes.reflections import LARGEST, closure, mirrors, rotation_axes

TETRAHEDRON = np.array([(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1.0)])
SOLIDS = {"Td": TETRAHEDRON, "Oh": trimesh.creation.box().vertices, "Ih": trimesh.creation.icosahedron().vertices}
AXES = {"Td": {3: 4, 2: 3}, "Oh": {4: 3, 3: 4, 2: 6}, "Ih": {5: 6, 3: 10, 2: 15}}


def symmetries(corners: np.ndarray) -> np.ndarray:
    """All orthogonal matrices that permute corners (V, 3) about the origin, by where three of them can go."""
    basis = next(
        list(each) for each in permutations(range(len(corners)), 3) if abs(np.linalg.det(corners[list(each)])) > 1e-6
    )
    inverse, found = np.linalg.inv(corners[basis].T), []
    for images in permutations(range(len(corners)), 3):
        matrix = corners[list(images)].T @ inverse
        if np.allclose(matrix @ matrix.T, np.eye(3), atol=1e-6):
            distances = np.linalg.norm((corners @ matrix.T)[:, None] - corners, axis=2)
            if (distances.min(axis=1) < 1e-6).all():
                found.append(matrix)
    return np.array(found)


def mirrors_among(elements: np.ndarray) -> np.ndarray:
    """The normals (M, 3) of the matrices that mirror."""
    chosen = elements[(np.linalg.det(elements) < 0) & (np.abs(np.trace(elements, axis1=1, axis2=2) - 1) < 1e-9)]
    return np.linalg.svd(chosen - np.eye(3))[2][:, 0]


@pytest.mark.parametrize("name", SOLIDS)
def test_the_polyhedral_groups_are_those_of_the_solids(name):
    elements = symmetries(SOLIDS[name] * 1.0)
    normals = mirrors_among(elements)
    table = mirrors(name)
    assert (len(closure(table.normals)), len(table.normals)) == (len(elements), len(normals))
    between, wanted = (np.sort(np.abs(each @ each.T), axis=None) for each in (table.normals, normals))
    np.testing.assert_allclose(between, wanted, atol=1e-9)
    orders = [axis.order for axis in rotation_axes(elements)]
    assert {order: orders.count(order) for order in orders} == AXES[name]
    assert orders == sorted(orders, reverse=True)


@pytest.mark.parametrize("fold", [2, 3, 4, 7, 12])
def test_the_axial_groups_have_as_many_elements_and_axes_as_they_should(fold):
    rotated, flat = closure(mirrors(f"C{fold}v").normals), closure(mirrors(f"D{fold}h").normals)
    assert (len(rotated), len(flat)) == (2 * fold, 4 * fold)
    (main,) = rotation_axes(rotated)
    np.testing.assert_allclose(main.direction, [0, 0, 1], atol=1e-9)
    assert main.order == fold
    orders = [axis.order for axis in rotation_axes(flat)]
    assert sorted(orders) == sorted([fold, *[2] * fold])


@pytest.mark.parametrize("name", ["Cs", "C2v", "C5v", "C6v", "D2h", "D3h", "D4h", "Td", "Oh", "Ih"])
def test_a_closed_group_has_just_its_mirrors_and_names_one_of_each_kind(name):
    table = mirrors(name)
    elements = closure(table.normals)
    assert len(mirrors_among(elements)) == len(table.normals)
    products = (elements[:, None] @ elements[None]).reshape(-1, 9)
    assert np.abs(products[:, None] - elements.reshape(-1, 9)).max(axis=2).min(axis=1).max() < 1e-9
    images = np.abs(np.einsum("gij,fj,mi->mfg", elements, table.normals[table.first], table.normals)).max(axis=2)
    assert ((images > 1 - 1e-9).sum(axis=1) == 1).all()  # every mirror is the image of one of them


def test_planes_that_generate_too_much_are_refused():
    angles = np.array([0, 1.0])  # radians: no part of a turn
    with pytest.raises(ValueError, match=f"more than {LARGEST}"):
        closure(np.stack([np.cos(angles), np.sin(angles), 0 * angles], 1))
    with pytest.raises(ValueError, match="C1v"):
        mirrors("C1v")
