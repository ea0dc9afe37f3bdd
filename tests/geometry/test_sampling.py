"""Farthest point sampling against its definition."""

import pytest
import torch

from symshrec.geometry.sampling import farthest_point_sampling


def plain_sampling(points: torch.Tensor, count: int) -> list[int]:
    chosen = [int(torch.linalg.norm(points - points.mean(0), dim=1).argmax())]
    while len(chosen) < count:
        chosen.append(int(torch.cdist(points, points[chosen]).min(1).values.argmax()))
    return chosen


def test_ragged_batch_equals_the_definition_cloud_by_cloud():
    generator = torch.Generator().manual_seed(0)
    clouds = [torch.randn(n, 3, generator=generator, dtype=torch.float64) for n in (50, 120, 31)]
    chosen = farthest_point_sampling(torch.cat(clouds), torch.tensor([50, 120, 31]), 30)
    assert chosen.tolist() == [plain_sampling(cloud, 30) for cloud in clouds]


def test_the_chosen_set_does_not_depend_on_the_order_of_points():
    points = torch.randn(200, 3, generator=torch.Generator().manual_seed(1), dtype=torch.float64)
    order = torch.randperm(200, generator=torch.Generator().manual_seed(2))
    straight = farthest_point_sampling(points, torch.tensor([200]), 40)[0]
    shuffled = farthest_point_sampling(points[order], torch.tensor([200]), 40)[0]
    torch.testing.assert_close(points[straight], points[order][shuffled])


def test_a_tiny_cloud_repeats_its_points_and_an_empty_one_is_refused():
    chosen = farthest_point_sampling(torch.eye(3), torch.tensor([3]), 8)
    assert set(chosen[0].tolist()) == {0, 1, 2}
    with pytest.raises(ValueError, match="at least one point"):
        farthest_point_sampling(torch.zeros(2, 3), torch.tensor([2, 0]), 4)
