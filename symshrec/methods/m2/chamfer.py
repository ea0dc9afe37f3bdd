"""§3.2 The symmetry term: the Chamfer distance D(P, P′) of clouds and mirror images, for many planes at once.

For a point p, a point q and the plane n·x + d = 0 with unit n and heights h(x) = n·x + d, mirroring p to p′ gives

    |p′ − q|² = |p − q|² + 4 h(p) h(q).

The right side does not tell p from q: a mirror is an isometry and its own inverse. So the two directions of D sum to
the same, one of them doubled is the whole, and all planes of a cloud share its distances |p − q|², each adding a
product of heights.
"""

import torch
from torch import Tensor

CHUNK_BYTES = {"cpu": 2**22, "cuda": 2**30}  # of distances at a time: what a core's cache holds, what fills a GPU
PACKABLE = {torch.float32: torch.int32, torch.float64: torch.int64}


def mirrored_chamfer(
    points: Tensor,
    normals: Tensor,
    offsets: Tensor,
    queries: Tensor | None = None,
    chunk_bytes: int | None = None,
) -> Tensor:
    """Σ_p min_q |p′ − q|² + Σ_q min_p |q − p′|² of every cloud and plane, in the cloud's unit squared.

    Differentiable in the planes, on any device, in the precision of the points also under autocast. A nearest point is
    looked for without gradient; its squared distance exceeds the least by at most a share of N · 2⁻²² (2⁻⁵¹ in double
    precision), because its place is written over the last bits of its distance.

    Args:
        points: (B, N, 3) float32 or float64.
        normals: (B, H, 3), of unit length.
        offsets: (B, H), d of n·x + d = 0.
        queries: (Q,) int64, distinct points whose mirror images alone are compared with the cloud; the result is scaled
            by N/Q, which makes it an estimate of the sum over all, without bias if they are drawn at random.
        chunk_bytes: memory for the distances between cloud and images at a time (at least one plane's are held at
            once); `CHUNK_BYTES` of the device where omitted. Changes nothing but speed.

    Returns:
        (B, H), not negative but for rounding.

    Raises:
        ValueError: for shapes that do not fit each other, no points or planes, or points in another precision.
    """
    clouds, count, heads = len(points), points.shape[1], normals.shape[1]
    if points.shape != (clouds, count, 3) or not count or points.dtype not in PACKABLE:
        raise ValueError(f"points are {points.dtype} {tuple(points.shape)}, expected float32 or float64 (B, N ≥ 1, 3)")
    if normals.shape != (clouds, heads, 3) or not heads or offsets.shape != (clouds, heads):
        shapes = f"normals {tuple(normals.shape)} and offsets {tuple(offsets.shape)}"
        raise ValueError(f"{shapes} do not fit {clouds} clouds; expected (B, H ≥ 1, 3) and (B, H)")
    if chunk_bytes is None:
        chunk_bytes = CHUNK_BYTES.get(points.device.type, CHUNK_BYTES["cpu"])
    with torch.autocast(points.device.type, enabled=False):
        heights = torch.baddbmm(offsets.to(points.dtype)[..., None], normals.to(points.dtype), points.mT)  # (B, H, N)
        mirrored, query_heights = points, heights
        if queries is not None:
            mirrored, query_heights = points[:, queries], heights[..., queries]
        with torch.no_grad():
            # Differences, not a product of matrices: close points must not drown in the rounding of far ones.
            distances = torch.cdist(mirrored, points, compute_mode="donot_use_mm_for_euclid_dist").square_()
            nearest = _nearest(distances, query_heights.detach(), heights.detach(), chunk_bytes)  # (B, H, Q)
            unmirrored = distances.gather(2, nearest.mT).mT  # (B, H, Q), of (B, Q, N)
        squares = unmirrored + 4 * query_heights * heights.gather(2, nearest)
        return squares.sum(2) * (2 * count / mirrored.shape[1])


def _nearest(distances: Tensor, query_heights: Tensor, heights: Tensor, chunk_bytes: int) -> Tensor:
    """argmin over q of |p − q|² + 4 h(p) h(q), from distances (B, Q, N) and heights (B, H, Q) and (B, H, N): (B, H, Q).

    Floats that are not negative sort as the integers of the same bits. With its last bits replaced by its place, each
    distance carries its index through a minimum, which costs a third of an argmin. Distances below zero, by rounding
    alone, are the least in either order.
    """
    clouds, heads, queries = query_heights.shape
    count = distances.shape[2]
    integer = PACKABLE[distances.dtype]
    places = torch.arange(count, dtype=integer, device=distances.device)
    place_bits = (1 << (count - 1).bit_length()) - 1
    pairs = max(1, chunk_bytes // (distances.element_size() * queries * count))
    head_step, cloud_step = min(pairs, heads), min(max(1, pairs // heads), clouds)
    chunk = distances.new_empty(cloud_step * head_step * queries * count)
    nearest = torch.empty(clouds, heads, queries, dtype=torch.int64, device=distances.device)
    for cloud in range(0, clouds, cloud_step):
        for head in range(0, heads, head_step):
            at = slice(cloud, cloud + cloud_step), slice(head, head + head_step)
            mirrored = query_heights[at][..., None]  # (b, h, Q, 1)
            squares = chunk[: mirrored.numel() * count].view(*mirrored.shape[:3], count)
            torch.addcmul(distances[at[0], None], mirrored, heights[at][:, :, None], value=4.0, out=squares)
            packed = squares.view(integer).bitwise_and_(~place_bits).bitwise_or_(places)
            nearest[at] = packed.amin(3).bitwise_and_(place_bits)
    return nearest
