"""§3.2 M2's speeds beside the same with a plain Chamfer distance and cleaning."""

from collections.abc import Callable, Iterator, Sequence
from itertools import islice

import torch
from torch import Tensor

from symshrec.benchmark.cloud import LabelledCloud
from symshrec.files.threads import one_thread
from symshrec.geometry.sampling import farthest_point_sampling
from symshrec.geometry.unit_sphere import UnitSphere
from symshrec.methods.m2.chamfer import mirrored_chamfer
from symshrec.methods.m2.module import M2
from symshrec.speed.plain import m2 as plain
from symshrec.speed.timing import Timing, seconds_of

BATCH = 32


def m2_timings(method: M2, clouds: Sequence[LabelledCloud]) -> Iterator[Timing]:
    """Milliseconds a cloud on one core, the network trained or not, on `BATCH` clouds: M2's loss and its detection."""
    clouds = list(islice(clouds, BATCH))
    method.eval()
    with one_thread(), torch.no_grad():
        points = _sampled(method, clouds)
        sphere = UnitSphere.of(points).apply(points)
        yield _chamfer(method, sphere)
        ours = _milliseconds(lambda: method.detect_sampled(points), len(clouds))
        other = _milliseconds(lambda: _detect_plainly(method, sphere), len(clouds))
        what = f"M2 ({method.points} points), network and cleaning, a cloud, one core"
        yield Timing(f"{what}, against plain Chamfer and cleaning", f"{ours:.1f} ms", f"{other:.1f} ms", other / ours)


def _sampled(method: M2, clouds: Sequence[LabelledCloud]) -> Tensor:
    points = [torch.from_numpy(cloud.points) for cloud in clouds]
    lengths = torch.tensor([len(each) for each in points])
    chosen = farthest_point_sampling(torch.cat(points), lengths, method.points)
    return torch.stack([cloud[indices] for cloud, indices in zip(points, chosen, strict=True)])


def _chamfer(method: M2, sphere: Tensor) -> Timing:
    """The loss of all heads' planes and its gradient, as in a step of training that takes all points."""
    planes = method.networks[0](sphere)

    def step(chamfer: Callable[[Tensor, Tensor, Tensor], Tensor]) -> None:
        with torch.enable_grad():
            normals, offsets = (each.detach().requires_grad_() for each in planes)
            chamfer(sphere, normals, offsets).sum().backward()

    ours = _milliseconds(lambda: step(mirrored_chamfer), len(sphere))
    other = _milliseconds(lambda: step(_plain_chamfer), len(sphere))
    what = f"M2, loss and gradient of {planes[1].shape[1]} mirror images of {method.points} points, one core"
    return Timing(f"{what}, against mirroring and cdist", f"{ours:.1f} ms", f"{other:.1f} ms", other / ours)


def _plain_chamfer(points: Tensor, normals: Tensor, offsets: Tensor) -> Tensor:
    return torch.stack([plain.mirrored_chamfer(*each) for each in zip(points, normals, offsets, strict=True)])


def _detect_plainly(method: M2, sphere: Tensor) -> list[list[int]]:
    normals, offsets = method.networks[0](sphere)
    losses = _plain_chamfer(sphere, normals, offsets)
    cleaning = method.settings.cleaning
    limits = cleaning.merge_rad, cleaning.mean_factor, cleaning.loss_limit
    return [plain.clean(*each, *limits) for each in zip(normals.double().numpy(), losses.double().numpy(), strict=True)]


def _milliseconds(work: Callable[[], object], clouds: int) -> float:
    work()
    return 1e3 * seconds_of(work, repeats=3) / clouds
