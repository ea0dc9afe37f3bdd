"""What detect draws: faces pixel by pixel, and planes in the colours and with the numbers of the table."""

from dataclasses import replace
from io import BytesIO

import numpy as np
import pytest
import trimesh
from matplotlib.colors import to_rgb
from PIL import Image

from symshrec.planes import Planes
from symshrec.reporting.figures.detection import picture
from symshrec.reporting.figures.drawing import View
from symshrec.reporting.figures.faces import rasterised
from symshrec.reporting.figures.outlines import outline
from symshrec.reporting.figures.page import cloud_page
from symshrec.reporting.figures.raster import Canvas
from symshrec.reporting.figures.subject import Subject
from symshrec.scans.meshes import sample_surface
from symshrec.scans.palette import COLOURS, colour_number
from symshrec.scans.polygons import Mesh


def subject(mesh, normals, faces=True):
    points = sample_surface(mesh.triangles, 4000, 0)
    planes = Planes(normals, np.zeros((len(normals), 3)), np.linspace(0.9, 0.5, len(normals)))
    own = Mesh(np.asarray(mesh.vertices), np.asarray(mesh.faces)) if faces else None
    return Subject(points, planes, own, planes.group(np.linalg.norm(np.ptp(points, axis=0))))


def around(angles):
    return np.stack([np.cos(angles), np.sin(angles), 0 * angles], 1)


def test_faces_cover_the_pixels_that_rays_hit_at_their_depth():
    ball = trimesh.creation.icosphere(2)
    canvas = Canvas.around(View(), ball.vertices, 120)
    depth, faces = rasterised(canvas, np.asarray(ball.triangles))
    towards = canvas.view.axes[2]
    starts = canvas.places(np.full((120, 120), 5.0)).reshape(-1, 3)
    hits = np.full(len(starts), -np.inf)
    for a, b, c in ball.triangles:  # Möller and Trumbore's
        inverse = np.linalg.inv(np.stack([b - a, c - a, towards], axis=1))
        u, v, t = inverse @ (starts - a).T
        hits = np.maximum(hits, np.where((u >= 0) & (v >= 0) & (u + v <= 1), 5.0 - t, -np.inf))
    hits = hits.reshape(120, 120)
    assert (np.isfinite(hits) != np.isfinite(depth)).mean() < 1e-3
    both = np.isfinite(hits) & np.isfinite(depth)
    np.testing.assert_allclose(depth[both], hits[both], atol=1e-6)
    assert (ball.face_normals[faces[faces >= 0]] @ towards > 0).all()


def test_a_plane_is_cut_to_the_shape():
    box = trimesh.creation.box((2, 4, 6)).vertices
    corners = outline(box, np.array([1.0, 0, 0]), np.zeros(3))
    np.testing.assert_allclose(corners[:, 0], 0, atol=1e-12)
    np.testing.assert_allclose(np.abs(corners[:, 1:]), [[2.36, 3.36]] * 4)  # and 0.06 × 6 around


def pixels_of(image, colour):
    return (np.abs(image - 255 * np.array(to_rgb(colour))).max(axis=2) < 8).sum()


def test_the_picture_has_every_planes_colour_and_the_scale_of_deviations():
    shape = subject(trimesh.creation.box((1, 2, 3)), np.eye(3))
    image = np.asarray(Image.open(BytesIO(picture(shape, dpi=60))).convert("RGB"), dtype=float)
    counts = [pixels_of(image, colour) for colour in COLOURS.values()]
    assert min(counts[:3]) > 20
    assert max(counts[3:]) == 0
    mapped = replace(shape, deviations=shape.points[:, 0], number=2)
    wider = np.asarray(Image.open(BytesIO(picture(mapped, dpi=60))).convert("RGB"), dtype=float)
    assert wider.shape[1] > image.shape[1]
    assert pixels_of(wider, COLOURS["blue"]) > 20 > pixels_of(wider, COLOURS["vermilion"])


def test_planes_of_a_revolution_share_their_colour_and_have_no_numbers():
    shape = subject(
        trimesh.creation.cylinder(1, 3, sections=64), np.vstack([around(np.linspace(0, 1.5, 16) ** 2), [0, 0, 1]])
    )
    numbers = [colour_number(shape.planes, shape.group, row) for row in range(17)]
    assert numbers == [1] * 16 + [2]
    assert not any(map(shape.numbered, range(17)))
    np.testing.assert_allclose(np.abs(shape.axis[:, :2]), 0, atol=1e-9)


@pytest.mark.parametrize("faces", [True, False])
def test_the_page_names_planes_as_the_table_and_has_the_files_coordinates(faces):
    pytest.importorskip("plotly")
    shape = subject(trimesh.creation.box((1, 2, 3)), np.eye(3), faces)
    page = cloud_page(shape, "a<b.ply", np.zeros((3, len(shape.points))))
    assert "<title>a&lt;b.ply</title>" in page
    for number, confidence in ((1, "0.90"), (2, "0.70"), (3, "0.50")):
        assert f"plane {number}, confidence {confidence}" in page
        assert f"\\u003cb\\u003e{number}\\u003c" in page
        assert f"deviation from plane {number}" in page
    assert "D2h: 3 mirror planes, 3 axes of order 2" in page
    assert ("12 triangles" in page) == faces
    assert ("4,000 points" in page) != faces
