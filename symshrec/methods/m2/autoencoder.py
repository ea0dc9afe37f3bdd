"""§3.2 Pre-training by masked autoencoding [PWT*22]: most patches are hidden, and their points told from the others."""

from dataclasses import dataclass

import torch
from torch import Tensor, nn

from symshrec.methods.m2.encoder import Encoder
from symshrec.methods.m2.settings import PretrainSettings
from symshrec.methods.m2.transformer import Transformer, position_mlp


@dataclass(frozen=True)
class Reconstruction:
    """What the autoencoder makes of B clouds; patches are in the coordinates of the cloud.

    loss (): see `chamfer_l2`; visible (B, V, K, 3): the patches seen; hidden and predicted (B, M, K, 3): the others and
    the answer to them.
    """

    loss: Tensor
    visible: Tensor
    hidden: Tensor
    predicted: Tensor


class MaskedAutoencoder(nn.Module):
    """The encoder, on visible patches alone, and a decoder that is thrown away after pre-training.

    Args:
        encoder: what is to be trained.
        pretrain: how much is hidden, and how deep the decoder is.

    Raises:
        ValueError: where the ratio leaves no patch visible or hides none.
    """

    def __init__(self, encoder: Encoder, pretrain: PretrainSettings):
        super().__init__()
        sizes, ratio = encoder.settings, pretrain.mask_ratio
        self.hidden_patches = int(ratio * sizes.groups)
        if not 0 < self.hidden_patches < sizes.groups:
            raise ValueError(
                f"pretrain.mask_ratio is {ratio}, which hides {self.hidden_patches} of {sizes.groups} patches"
            )
        self.encoder = encoder
        self.mask_token = nn.Parameter(0.02 * torch.randn(sizes.width))
        self.positions = position_mlp(sizes.width)
        self.decoder = Transformer(sizes.width, pretrain.decoder_depth, sizes.heads, sizes.drop_path)
        self.to_points = nn.Linear(sizes.width, 3 * sizes.neighbours)

    def forward(self, clouds: Tensor, generator: torch.Generator | None = None) -> Reconstruction:
        """Hide patches of clouds (B, N, 3) at random and predict them.

        Args:
            clouds: centred, on the unit sphere.
            generator: of the mask, on the clouds' device; the global one where omitted.
        """
        centres, patches = self.encoder.patches(clouds)
        shuffled = torch.rand(centres.shape[:2], generator=generator, device=clouds.device).argsort(1)
        rows = torch.arange(len(clouds), device=clouds.device)[:, None]
        centres, patches = centres[rows, shuffled], patches[rows, shuffled]  # the hidden ones first
        hidden = self.hidden_patches

        encoded = self.encoder.tokens(centres[:, hidden:], patches[:, hidden:])
        masked = self.mask_token.to(encoded.dtype).expand(len(clouds), hidden, -1)
        decoded = self.decoder(torch.cat([masked, encoded], 1), self.positions(centres))[:, :hidden]
        predicted = self.to_points(decoded).float().unflatten(2, (-1, 3))  # (B, M, K, 3)

        loss = chamfer_l2(predicted, patches[:, :hidden])
        patches = patches + centres[:, :, None]
        return Reconstruction(loss, patches[:, hidden:], patches[:, :hidden], predicted + centres[:, :hidden, None])


def chamfer_l2(predicted: Tensor, patches: Tensor) -> Tensor:
    """Mean squared distance to the nearest point, from predicted to true patches (..., K, 3) and back, summed: ()."""
    predicted, patches = predicted.flatten(0, -3), patches.flatten(0, -3)
    with torch.no_grad():
        distances = torch.cdist(predicted, patches, compute_mode="donot_use_mm_for_euclid_dist")
        there, back = distances.argmin(2), distances.argmin(1)
    rows = torch.arange(len(patches), device=patches.device)[:, None]
    forward = (predicted - patches[rows, there]).square().sum(-1).mean()
    return forward + (patches - predicted[rows, back]).square().sum(-1).mean()
