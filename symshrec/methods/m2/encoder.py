"""§3.2 The backbone: a plain vision transformer over the patches of a cloud, as in Point-MAE [PWT*22]."""

import torch
from torch import Tensor, nn

from symshrec.methods.m2.patches import PatchEmbedding, cut_patches
from symshrec.methods.m2.settings import NetworkSettings
from symshrec.methods.m2.transformer import Transformer, position_mlp


class Encoder(nn.Module):
    """Clouds to tokens, one per patch, or to one global feature of twice the width."""

    def __init__(self, settings: NetworkSettings):
        super().__init__()
        self.settings, width = settings, settings.width
        self.embedding = PatchEmbedding(width)
        self.positions = position_mlp(width)
        self.transformer = Transformer(width, settings.depth, settings.heads, settings.drop_path)
        self.class_token = nn.Parameter(0.02 * torch.randn(width))
        self.class_position = nn.Parameter(0.02 * torch.randn(width))

    def patches(self, clouds: Tensor) -> tuple[Tensor, Tensor]:
        """Centres (B, G, 3) and centred patches (B, G, K, 3) of clouds (B, N, 3); see `cut_patches`."""
        return cut_patches(clouds, self.settings.groups, self.settings.neighbours)

    def tokens(self, centres: Tensor, patches: Tensor) -> Tensor:
        """Some patches of each cloud, (B, G', 3) and (B, G', K, 3), encoded without class token: (B, G', width)."""
        return self.transformer(self.embedding(patches), self.positions(centres))

    def forward(self, clouds: Tensor) -> Tensor:
        """The global feature: the class token beside the maximum over the patches.

        Pre-training does not see the class token: it starts afresh.

        Args:
            clouds: (B, N, 3), centred and scaled to the unit sphere, N at least `neighbours`.

        Returns:
            (B, 2 · width), the same for any order of the points.
        """
        centres, patches = self.patches(clouds)
        embedded, places = self.embedding(patches), self.positions(centres)
        leading = [
            each.to(embedded.dtype).expand(len(clouds), 1, -1) for each in (self.class_token, self.class_position)
        ]
        tokens = self.transformer(torch.cat([leading[0], embedded], 1), torch.cat([leading[1], places], 1))
        return torch.cat([tokens[:, 0], tokens[:, 1:].amax(1)], 1)
