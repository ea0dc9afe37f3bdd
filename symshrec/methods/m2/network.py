"""§3.2, figure 4: the backbone and its heads."""

from torch import Tensor, nn

from symshrec.methods.m2.encoder import Encoder
from symshrec.methods.m2.heads import PlaneHeads
from symshrec.methods.m2.settings import NetworkSettings


class M2Network(nn.Module):
    """Clouds on the unit sphere → one plane from every head."""

    def __init__(self, settings: NetworkSettings):
        super().__init__()
        self.encoder = Encoder(settings)
        self.heads = PlaneHeads(2 * settings.width, settings.planes, settings.hidden, settings.dropout, settings.spread)

    def forward(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """Planes n·x + d = 0 of clouds (B, N, 3): unit normals (B, H, 3) and offsets d (B, H), in float32."""
        return self.heads(self.encoder(points))
