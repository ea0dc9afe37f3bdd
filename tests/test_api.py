"""`symshrec.detect`: the same kind out as went in, in the input's own coordinates, and what has no answer."""

import subprocess
import sys

import numpy as np
import pytest
import torch

import symshrec
from symshrec.api import Frame, named_method
from symshrec.geometry.straight import STRAIGHT
from symshrec.methods.base import SymmetryMethod
from symshrec.methods.detector import TrainingFree
from symshrec.methods.settings import MethodSettings
from symshrec.planes import Planes, axis_angles
from symshrec.runs.config import load, method_of

METHOD = "m4"
BOX = np.array([1.0, 2.0, 3.0])
ROTATION = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]


class BoxMethod(SymmetryMethod):
    """Gives a box's three planes, through the middle of what it is shown."""

    def detect(self, points):
        self.seen = points
        middle = (points.amin(0) + points.amax(0)).double().numpy() / 2
        return Planes(np.diag([1.0, -1.0, 1.0]), np.tile(middle + np.array([0, 0.1, 0]), (3, 1)), [0.2, 0.9, 0.6])


def box_points(count=600):
    """Points on a box about the origin, each with its seven mirror images."""
    rng = np.random.default_rng(0)
    points = rng.uniform(0, 1, size=(count // 8, 3))
    points[np.arange(len(points)), rng.integers(0, 3, len(points))] = 1
    signs = np.stack(np.meshgrid(*3 * [[-1, 1]]), axis=-1).reshape(-1, 3)
    return (points[:, None] * signs).reshape(-1, 3) * BOX


def special(name):
    rng, turn = np.random.default_rng(0), np.linspace(0, 2 * np.pi, 600, endpoint=False)
    sphere = rng.normal(size=(800, 3))
    sphere /= np.linalg.norm(sphere, axis=1, keepdims=True)
    return {
        "sphere": sphere,
        "cylinder": np.stack([np.cos(turn), np.sin(turn), 3 * rng.random(600)], axis=1),
        "patch": box_points(1200)[:, :] * [1, 1, 0],
        "duplicates": np.repeat(box_points(), 3, axis=0),
    }[name]


def test_arrays_give_planes_in_their_own_coordinates():
    points = 1000 * box_points() @ ROTATION.T + [4.5e6, 5e5, 30.0]
    method = BoxMethod()
    planes = symshrec.detect(points, method, min_confidence=0)
    assert isinstance(planes, symshrec.Planes)
    assert planes.confidences.tolist() == [0.9, 0.6, 0.2]
    assert method.seen.dtype == torch.float32
    low, high = method.seen.amin(0), method.seen.amax(0)
    np.testing.assert_allclose((low + high) / 2, 0, atol=1e-7)
    assert float((high - low).norm()) == pytest.approx(1, abs=1e-6)
    diagonal = np.linalg.norm(np.ptp(points, axis=0))
    middle = (points.min(0) + points.max(0)) / 2
    shift = [0.1 * diagonal, 0, 0]  # of the plane across y, which comes first; the others run along y
    np.testing.assert_allclose(
        np.einsum("kd,kd->k", planes.normals, planes.points - middle), shift, atol=1e-6 * diagonal
    )
    assert (np.take_along_axis(planes.normals, np.abs(planes.normals).argmax(1)[:, None], 1) > 0).all()
    feet = planes.points - points.mean(0)
    np.testing.assert_allclose(np.cross(feet, planes.normals), 0, atol=1e-6 * diagonal)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64, torch.float16, torch.int64])
def test_tensors_give_tensors(dtype):
    points = (100 * torch.from_numpy(box_points())).to(dtype)
    found = symshrec.detect(points, BoxMethod(), min_confidence=0.5)
    expected = symshrec.detect(points.double().numpy(), BoxMethod(), min_confidence=0.5)
    for tensor, array in zip(found, (expected.normals, expected.points, expected.confidences), strict=True):
        assert tensor.dtype == (dtype if dtype.is_floating_point else torch.float32)
        np.testing.assert_allclose(tensor.double(), array, rtol=1e-2 if dtype == torch.float16 else 1e-6, atol=1e-5)
    tracked = points.double().requires_grad_()
    assert not symshrec.detect(tracked, BoxMethod()).normals.requires_grad
    assert len(symshrec.detect(points.tolist(), BoxMethod())) == 2


def test_limits():
    points, method = box_points(), BoxMethod(MethodSettings(count_threshold=0.65))
    assert symshrec.detect(points, method).confidences.tolist() == [0.9]
    assert symshrec.detect(points, method, min_confidence=0.6).confidences.tolist() == [0.9, 0.6]
    assert symshrec.detect(points, method, min_confidence=0, max_planes=1).confidences.tolist() == [0.9]
    assert len(symshrec.detect(points, method, min_confidence=0.95)) == 0
    assert len(symshrec.detect(torch.from_numpy(points), method, min_confidence=0.95).normals) == 0
    symshrec.detect(points, method, max_points=100)
    first = method.seen
    assert first.shape == (100, 3)
    symshrec.detect(points, method, max_points=100)
    assert torch.equal(method.seen, first)
    for wrong, problem in (
        ({"min_confidence": float("nan")}, "min_confidence is nan"),
        ({"max_planes": 0}, "max_planes is 0"),
        ({"max_points": 0}, "max_points is 0"),
        ({"neighbours": 3}, "neighbours cannot change a method"),
    ):
        with pytest.raises(ValueError, match=problem):
            symshrec.detect(points, method, **wrong)


def test_a_method_by_name_takes_its_arguments_and_is_made_once():
    assert named_method("m3", neighbours=17).settings.neighbours == 17
    assert named_method("m3", neighbours=17) is named_method("m3", neighbours=17)
    for arguments, problem in (
        (("m5",), "there is no method 'm5'; there is m1, .*m3, m4"),
        (("../m3",), "there is no method"),
        (("m3", {"neighbors": 5}), "method m3 has no argument 'neighbors'; it has .*neighbours"),
        (("m3", {"neighbours": "many"}), "method m3: Value 'many'"),
        (("m3", {"neighbours": -1}), "method m3: neighbours is -1"),
        (("m4", {"separation_deg": -1, "refine": True}), "method m4: separation_deg is -1"),
    ):
        name, settings = arguments[0], dict(*arguments[1:])
        with pytest.raises(ValueError, match=problem):
            named_method(name, **settings)


@pytest.mark.parametrize("name", ["m3", "m4"])
@pytest.mark.parametrize("refine", [False, True])
def test_a_method_by_name_finds_what_its_lightning_module_finds(name, refine):
    points, arguments = box_points(2000) @ ROTATION.T + 3, {"neighbours": 20, "refine": refine, "workers": 1}
    by_name = symshrec.detect(points, name, min_confidence=0, **arguments)
    ready = method_of(load([f"method={name}", *(f"method.{key}={value}" for key, value in arguments.items())]))
    by_module = symshrec.detect(points, ready, min_confidence=0)
    assert len(by_name)
    assert named_method(name, **arguments).count_threshold == ready.count_threshold
    for field in ("normals", "points", "confidences"):
        np.testing.assert_array_equal(getattr(by_name, field), getattr(by_module, field))


def test_a_training_free_method_computes_on_one_thread_and_gives_the_others_back():
    threads = torch.get_num_threads()
    seen = []
    method = TrainingFree(lambda points, _: seen.append(torch.get_num_threads()) or Planes.empty(), MethodSettings())
    try:
        torch.set_num_threads(2)
        symshrec.detect(box_points(), method)
        assert (seen, torch.get_num_threads()) == ([1], 2)
    finally:
        torch.set_num_threads(threads)


@pytest.mark.parametrize("given", [np.asarray, torch.from_numpy])
def test_the_planes_of_a_turned_box(given):
    points = box_points() @ ROTATION.T * 5 + 70
    normals, places, confidences = (
        np.asarray(getattr(symshrec.detect(given(points), METHOD), name))
        for name in ("normals", "points", "confidences")
    )
    angles = np.degrees(axis_angles(normals, ROTATION.T)).min(axis=1)
    assert len(normals) >= 3
    assert angles[:3].max() < 1
    np.testing.assert_allclose(np.einsum("kd,kd->k", normals[:3], places[:3] - 70), 0, atol=0.05)
    assert (np.diff(confidences) <= 0).all()


@pytest.mark.parametrize("name", ["sphere", "cylinder", "patch", "duplicates"])
def test_special_shapes_have_planes_through_their_middle(name):
    points = special(name)
    planes = symshrec.detect(points + 10, METHOD)
    middle, diagonal = (points.min(0) + points.max(0)) / 2 + 10, np.linalg.norm(np.ptp(points, axis=0))
    assert len(planes)
    heights = np.einsum("kd,kd->k", planes.normals, planes.points - middle)
    assert np.abs(heights).max() < 0.05 * diagonal


def test_a_cloud_without_symmetry_has_no_plane():
    rng = np.random.default_rng(0)
    walk = np.cumsum(rng.normal(size=(60, 3)), axis=0)
    points = walk[rng.integers(0, 60, 4000)] + 0.3 * rng.normal(size=(4000, 3))
    assert len(symshrec.detect(points, METHOD)) == 0


def test_duplicates_change_no_plane():
    once, thrice = (symshrec.detect(np.repeat(box_points(), times, axis=0), METHOD) for times in (1, 3))
    np.testing.assert_allclose(thrice.normals, once.normals, atol=1e-5)
    np.testing.assert_allclose(thrice.confidences, once.confidences, atol=1e-5)


@pytest.mark.parametrize("count", [1, 3])
def test_a_large_cloud_is_measured_in_blocks(count, monkeypatch):
    points = box_points() @ ROTATION.T * [3, 1, 1] + [4.5e6, 5e5, 30.0]
    whole = Frame.of(points)
    monkeypatch.setattr("symshrec.geometry.straight.BLOCK", len(points) // count - 1)
    frame = Frame.of(points)
    np.testing.assert_array_equal(frame.centre, (points.min(axis=0) + points.max(axis=0)) / 2)
    assert frame.diagonal == np.linalg.norm(np.ptp(points, axis=0))
    np.testing.assert_allclose(frame.centroid, whole.centroid, atol=1e-9)
    np.testing.assert_allclose(frame.centroid, (points - frame.centre).mean(axis=0), atol=1e-9)


@pytest.mark.parametrize(
    ("points", "problem"),
    [
        (np.zeros((1, 3)), "in one place"),
        (np.full((50, 3), 7.1), "in one place"),
        (np.outer(np.arange(50), [1, 2, 3.3]), "on a straight line"),
        (np.outer(np.arange(50), [1, 2, 3.3]).astype(np.float32) + 40, "on a straight line"),
        (np.arange(6.0).reshape(2, 3), "on a straight line"),
        (np.zeros((5, 2)), r"float64 \(5, 2\).*add a column of zeros"),
        (np.zeros((0, 3)), r"\(0, 3\)"),
        (np.zeros((2, 5, 3)), r"\(2, 5, 3\)"),
        (np.array([[0, 0, 0], [1, np.nan, 0]]), "point 1 is"),
        (np.zeros((4, 3), complex), "complex128"),
        ([["a", "b", "c"]], "<U1"),
        (np.diag([1e300, 1e300, 1e300]), "too far"),
    ],
)
def test_what_has_no_answer(points, problem):
    with pytest.raises(ValueError, match=problem):
        symshrec.detect(points, BoxMethod())


def test_a_thin_cloud_is_no_line():
    thin = box_points() * [1, 100 * STRAIGHT, 0]
    assert len(symshrec.detect(thin, BoxMethod(), min_confidence=0)) == 3


def test_detection_does_not_wait_for_lightning():
    check = (
        "import sys, numpy, symshrec; symshrec.detect(numpy.random.default_rng(0).normal(size=(100, 3)))\n"
        "print(*{'lightning', 'torchmetrics', 'sklearn', 'matplotlib'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", check], check=True, capture_output=True, text=True)
    assert done.stdout.split() == []


def test_importing_the_package_is_light():
    check = "import sys, symshrec; sys.exit('numpy' in sys.modules or 'detect' not in dir(symshrec))"
    assert subprocess.run([sys.executable, "-c", check], check=False).returncode == 0
    with pytest.raises(AttributeError, match="fly"):
        _ = symshrec.fly
