"""M4 step 4: mirror planes of one object form a reflection group; its relations tie the planes' estimates together.

A cloud symmetric about planes j and k is symmetric about the image of k in j. Where that image is near another
plane l of the set, the relation "the image of k in j is l" is one more equation for all three.
"""

from dataclasses import dataclass
from math import cos, radians

import torch
from torch import Tensor

ORBIT_ROUNDS = 3


@dataclass(frozen=True)
class Relations:
    """R relations: the image of `second` in `mirror` is plane `image`, its normal times `sign`; (R,) each."""

    mirror: Tensor
    second: Tensor
    image: Tensor
    sign: Tensor

    def among(self, planes: Tensor) -> "Relations":
        """Those whose three planes are all among `planes` (K,) bool."""
        rows = planes[self.mirror] & planes[self.second] & planes[self.image]
        return self._at(rows)

    def mirrored_in(self, planes: Tensor) -> "Relations":
        """Those whose mirror is among `planes` (K,) bool."""
        return self._at(planes[self.mirror])

    def _at(self, rows: Tensor) -> "Relations":
        return Relations(self.mirror[rows], self.second[rows], self.image[rows], self.sign[rows])


def images_of_planes(normals: Tensor, offsets: Tensor) -> tuple[Tensor, Tensor]:
    """Every plane mirrored in every plane: normals (K, K, 3) and offsets (K, K), the first index being the mirror."""
    cosines = normals @ normals.T
    images = normals[None] - 2 * cosines[..., None] * normals[:, None]
    return images, offsets[None] - 2 * cosines * offsets[:, None]


def find_relations(normals: Tensor, offsets: Tensor, angle_deg: float, distance: float) -> Relations:
    """Relations that hold within `angle_deg` (degrees) and `distance` among planes normals (K, 3), offsets (K,)."""
    images, image_offsets = images_of_planes(normals, offsets)
    cosines = images @ normals.T  # (K, K, K)
    nearest = cosines.abs().argmax(-1)
    cosine = cosines.gather(-1, nearest[..., None])[..., 0]
    gaps = (image_offsets * cosine.sign() - offsets[nearest]).abs()
    holds = (cosine.abs() > cos(radians(angle_deg))) & (gaps < distance)
    holds.fill_diagonal_(False)
    mirror, second = torch.nonzero(holds, as_tuple=True)
    return Relations(mirror, second, nearest[mirror, second], cosine[mirror, second].sign())


def relation_system(relations: Relations, normals: Tensor, offsets: Tensor, basis: Tensor) -> tuple[Tensor, Tensor]:
    """Normal equations (3K, 3K) and (3K,) of the relations for steps along the tangents (K, 2, 3) and the offset."""
    normals, offsets, basis = normals.double(), offsets.double(), basis.double()
    planes, count = len(normals), len(relations.mirror)
    j, k, l = relations.mirror, relations.second, relations.image  # noqa: E741
    sign = relations.sign.double()
    nj, nk, dj = normals[j], normals[k], offsets[j]
    cosine = (nj * nk).sum(1)
    off = torch.cat(
        [
            nk - 2 * cosine[:, None] * nj - sign[:, None] * normals[l],
            (offsets[k] - 2 * cosine * dj - sign * offsets[l])[:, None],
        ],
        1,
    )  # (R, 4)
    eye = torch.eye(4, dtype=torch.float64, device=normals.device)
    of_mirror = -2 * cosine[:, None, None] * eye
    of_mirror[:, :3, :3] -= 2 * nj[:, :, None] * nk[:, None, :]
    of_mirror[:, 3, :3] -= 2 * dj[:, None] * nk
    of_second = eye.expand(count, 4, 4).clone()
    of_second[:, :3, :3] -= 2 * nj[:, :, None] * nj[:, None, :]
    of_second[:, 3, :3] -= 2 * dj[:, None] * nj
    lift = torch.zeros(planes, 4, 3, dtype=torch.float64, device=normals.device)
    lift[:, :3, :2] = basis.mT
    lift[:, 3, 2] = 1
    jacobian = torch.zeros(count, planes, 4, 3, dtype=torch.float64, device=normals.device)
    rows = torch.arange(count, device=normals.device)
    for index, block in ((j, of_mirror), (k, of_second), (l, -sign[:, None, None] * eye)):
        jacobian.index_put_((rows, index), block @ lift[index], accumulate=True)
    flat = jacobian.permute(0, 2, 1, 3).reshape(4 * count, 3 * planes)
    return flat.T @ flat, flat.T @ off.reshape(-1)


def orbit_means(values: Tensor, relations: Relations) -> Tensor:
    """Values (K,) of planes, each the mean over the planes that the relations' mirrors turn it into.

    Planes that are images of each other in a symmetric cloud fit it equally well, but for chance.
    """
    links = torch.eye(len(values), dtype=values.dtype, device=values.device)
    links[relations.image, relations.second] = 1
    links[relations.second, relations.image] = 1
    links = links / links.sum(1, keepdim=True)
    for _ in range(ORBIT_ROUNDS):
        values = links @ values
    return values


def closure(normals: Tensor, offsets: Tensor, separation_deg: float, most: int) -> tuple[Tensor, Tensor]:
    """Images of planes (K, 3), (K,) in one another that are over `separation_deg` from all and each other.

    Returns:
        At most `most` normals and offsets, the images in the first planes first.
    """
    images, image_offsets = (each.flatten(0, 1) for each in images_of_planes(normals, offsets))
    cosine = cos(radians(separation_deg))
    new = torch.nonzero(((images @ normals.T).abs() < cosine).all(1))[:, 0]
    kept = []
    while len(new) and len(kept) < most:
        kept.append(new[0])
        new = new[(images[new] @ images[new[0]]).abs() < cosine]
    rows = torch.tensor(kept, dtype=torch.int64, device=normals.device)
    return images[rows], image_offsets[rows]


def distinct(normals: Tensor, values: Tensor, separation_deg: float) -> Tensor:
    """Rows of the planes by ascending value, each over `separation_deg` from all kept before it."""
    order = torch.argsort(values, stable=True)
    close = ((normals[order] @ normals[order].T).abs() > cos(radians(separation_deg))).tolist()
    kept = []
    for row, near in enumerate(close):
        if not any(near[each] for each in kept):
            kept.append(row)
    return order[kept]
