"""§3.2 A cloud as patches, as in Point-MAE [PWT*22]: centres, their neighbourhoods, and a small PointNet on each."""

import torch
from torch import Tensor, nn

from symshrec.geometry.sampling import farthest_point_sampling


@torch.no_grad()
def cut_patches(clouds: Tensor, groups: int, neighbours: int) -> tuple[Tensor, Tensor]:
    """Farthest point centres and the nearest points of each, which may be shared between patches.

    Neither depends on the order of the points, but for that of points at equal distance.

    Args:
        clouds: (B, N, 3) float32 or float64.
        groups: G; a cloud of fewer distinct points repeats a centre.
        neighbours: K, the centre itself included.

    Returns:
        Centres (B, G, 3) and patches (B, G, K, 3), each relative to its centre, in no order.

    Raises:
        ValueError: for another shape, or clouds of fewer than K points.
    """
    if clouds.ndim != 3 or clouds.shape[2] != 3 or clouds.shape[1] < neighbours:
        raise ValueError(
            f"clouds have shape {tuple(clouds.shape)}, expected (B, N, 3) with N ≥ {neighbours} neighbours"
        )
    lengths = torch.full(clouds.shape[:1], clouds.shape[1], device=clouds.device)
    chosen = farthest_point_sampling(clouds.flatten(0, 1), lengths, groups)
    rows = torch.arange(len(clouds), device=clouds.device)[:, None]
    centres = clouds[rows, chosen]
    distances = torch.cdist(centres, clouds, compute_mode="donot_use_mm_for_euclid_dist")  # (B, G, N)
    nearest = distances.topk(neighbours, largest=False, sorted=False).indices
    return centres, clouds[rows[..., None], nearest] - centres[:, :, None]


class PatchEmbedding(nn.Module):
    """A PointNet on each patch: (B, G, K, 3) → (B, G, width), whatever the order of the K points.

    3 → 128 → 256, maximum, joined to each point's own 256, 512 → 512 → width, maximum, for the published width 384; in
    proportion (width/3, 2/3, 4/3) for others. The joined 512 → 512 layer is applied in two parts, so that the patch's
    half is computed once per patch and not once per point.
    """

    def __init__(self, width: int):
        super().__init__()
        narrow, middle, wide = width // 3, 2 * width // 3, 4 * width // 3
        self.points = nn.Sequential(
            nn.Linear(3, narrow), nn.BatchNorm1d(narrow), nn.ReLU(inplace=True), nn.Linear(narrow, middle)
        )
        self.join_point = nn.Linear(middle, wide, bias=False)
        self.join_patch = nn.Linear(middle, wide)
        self.joined = nn.Sequential(nn.BatchNorm1d(wide), nn.ReLU(inplace=True), nn.Linear(wide, width))

    def forward(self, patches: Tensor) -> Tensor:
        clouds, groups, neighbours, _ = patches.shape
        local = self.points(patches.reshape(-1, 3)).view(clouds * groups, neighbours, -1)
        joined = self.join_point(local) + self.join_patch(local.amax(1))[:, None]
        features = self.joined(joined.flatten(0, 1)).view(clouds, groups, neighbours, -1)
        return features.amax(2)
