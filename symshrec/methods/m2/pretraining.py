"""§3.2 The pre-training of M2's encoder [PWT*22]: a method that is trained, and whose weights M2 starts from."""

import torch
from torch import Tensor, nn

from symshrec.data.batch import Batch, SampledBatch
from symshrec.geometry.unit_sphere import UnitSphere
from symshrec.methods.m2.autoencoder import MaskedAutoencoder, Reconstruction
from symshrec.methods.m2.encoder import Encoder
from symshrec.methods.m2.module import M2, PRETRAINED
from symshrec.methods.m2.settings import NetworkSettings
from symshrec.planes import Planes


class M2Pretraining(M2):
    """Learns to tell hidden patches of clouds from the others; needs no truth, and finds no planes.

    Of M2's settings only the encoder's and `pretrain` matter.
    """

    name = PRETRAINED

    def network_of(self, settings: NetworkSettings) -> nn.Module:
        encoder = Encoder(settings)
        for unused in (encoder.class_token, encoder.class_position):
            unused.requires_grad_(False)
        return MaskedAutoencoder(encoder, self.settings.pretrain)

    def losses(self, batch: SampledBatch) -> dict[str, Tensor]:
        """What the reconstruction is off, see `chamfer_l2`."""
        return {"loss": self.reconstruct(batch.points).loss}

    def reconstruct(self, points: Tensor) -> Reconstruction:
        """Clouds (B, N, 3) on the unit sphere; outside training the same patches are hidden every time."""
        chance = None if self.training else torch.Generator(points.device).manual_seed(0)
        return self.networks[0](UnitSphere.of(points).apply(points), chance)

    def validation_step(self, batch: Batch, batch_idx: int) -> Reconstruction:
        """Loss of a batch; returns its reconstruction, for callbacks to show."""
        answer = self.reconstruct(batch.sampled)
        self.log("val/loss", answer.loss, batch_size=len(batch), sync_dist=True)
        return answer

    def detect_sampled(self, points: Tensor) -> list[Planes]:
        raise ValueError(
            "a pre-training has no heads that could find planes; train M2 from its weights with run=m2 train.init=FILE"
        )
