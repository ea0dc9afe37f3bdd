"""§3.1.1 M1's speeds beside the same network in single precision, cloud by cloud, with scikit-learn's DBSCAN."""

import copy
from collections.abc import Iterator, Sequence
from functools import partial
from itertools import islice

import numpy as np
import torch
from torch import Tensor

from symshrec.benchmark.cloud import LabelledCloud
from symshrec.data.batch import SampledBatch
from symshrec.files.threads import one_thread
from symshrec.geometry.sampling import farthest_point_sampling
from symshrec.geometry.unit_sphere import UnitSphere
from symshrec.methods.m1.decode import decode
from symshrec.methods.m1.module import M1
from symshrec.speed.plain.m1 import PlainPCT, plain_decode, plain_loss
from symshrec.speed.timing import Timing, seconds_of

BATCH = 32
PUBLISHED_NETWORK, PUBLISHED_REST = "8.7 ms on a GPU", "110 ms"


def m1_timings(method: M1, clouds: Sequence[LabelledCloud]) -> Iterator[Timing]:
    """Clouds/s of training and ms a cloud of detection on one core, the network trained or not, on `BATCH` clouds."""
    clouds = list(islice(clouds, BATCH))
    with one_thread():
        sampled = _sampled(method, clouds)
        yield _training(method, sampled)
        yield from _detection(method.eval(), clouds, sampled)


def _sampled(method: M1, clouds: Sequence[LabelledCloud]) -> SampledBatch:
    points = [torch.from_numpy(cloud.points) for cloud in clouds]
    lengths = torch.tensor([len(each) for each in points])
    chosen = farthest_point_sampling(torch.cat(points), lengths, method.points)
    rows = torch.stack([cloud[indices] for cloud, indices in zip(points, chosen, strict=True)])
    return SampledBatch.of(rows, [cloud.planes for cloud in clouds])


def _training(method: M1, batch: SampledBatch) -> Timing:
    """A step of forward, loss and backward; the optimiser's share is small and the same for both."""
    learner = copy.deepcopy(method).train()
    plain = PlainPCT(copy.deepcopy(learner.networks[0])).train()

    def ours() -> None:
        learner.zero_grad()
        with torch.autocast("cpu", torch.bfloat16):
            loss = learner.losses(batch)["loss"]
        loss.backward()

    def plainly() -> None:
        plain.zero_grad()
        frame = UnitSphere.of(batch.points)
        points, centres = frame.apply(batch.points), frame.apply(batch.centres)
        for cloud, normals, count, centre in zip(points, batch.normals, batch.counts, centres, strict=True):
            plain_loss(plain(cloud), normals[:count], centre).backward()

    ours()
    fast, slow = (len(batch) / seconds_of(step, repeats=3) for step in (ours, plainly))
    what = f"M1 ({method.points} points), training, one core, bf16 in batches of {len(batch)} against a plain one"
    return Timing(what, f"{fast:.0f} clouds/s", f"{slow:.0f} clouds/s", fast / slow)


def _detection(method: M1, clouds: Sequence[LabelledCloud], batch: SampledBatch) -> Iterator[Timing]:
    plain, points = PlainPCT(method.networks[0]).eval(), UnitSphere.of(batch.points).apply(batch.points)

    def plainly() -> list:
        return [plain_decode(*_arrays(plain(cloud))) for cloud in points]

    with torch.no_grad():
        ours, other = (
            1e3 * seconds_of(work, repeats=3) / len(batch)
            for work in (lambda: method.detect_sampled(batch.points), plainly)
        )
        size = f"{method.points} points"
        yield Timing(f"M1 ({size}), network and clusters, a cloud, one core, against a plain one (published: "
                     f"{PUBLISHED_NETWORK} and {PUBLISHED_REST})",
                     f"{ours:.1f} ms", f"{other:.0f} ms", other / ours)  # fmt: skip
        said = [_arrays(plain(cloud)) for cloud in points]
        ours, other = (
            1e3 * seconds_of(work, repeats=3) / len(batch)
            for work in (
                lambda: [decode(*each, method.settings.decode) for each in said],
                lambda: [plain_decode(*each) for each in said],
            )
        )
        yield Timing(f"M1 ({size}), clusters alone, a cloud, against scikit-learn's on all predictions (published: "
                     f"{PUBLISHED_REST})", f"{ours:.1f} ms", f"{other:.0f} ms", other / ours)  # fmt: skip
    whole = 1e3 * float(
        np.median([seconds_of(partial(method.detect, torch.from_numpy(each.points))) for each in clouds])
    )
    yield Timing(f"M1 ({size}), median a cloud alone with its sampling, against the published time",
                 f"{whole:.1f} ms", "119 ms with a GPU", 119 / whole)  # fmt: skip


def _arrays(said: tuple[Tensor, Tensor, Tensor]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    normals, logits, centres = (each.double().numpy() for each in said)
    return normals, 1 / (1 + np.exp(-logits)), centres
