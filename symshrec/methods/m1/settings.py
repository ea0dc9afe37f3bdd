"""§3.1 What can be chosen about M1. No torch here: the schema of conf/ is made of these."""

from dataclasses import dataclass, field
from enum import Enum

from symshrec.methods.settings import HARMLESS, LearnedSettings


class Encoder(Enum):
    """How per-point features are made: shared layers with a maximum over points (R1), or offset attention (R2–R4)."""

    pointnet = "pointnet"
    pct = "pct"


class VectorForm(Enum):
    """What is charged for the angle θ to the true normal: sin²θ, which is Eq. 3, or sin θ, steep down to zero."""

    squared = "squared"
    sine = "sine"


@dataclass(frozen=True)
class NetworkSettings:
    """The network of figure 3.

    Args:
        encoder: see `Encoder`.
        points: N, drawn by farthest point sampling.
        channels: width of the attention layers, of which there are `layers` (PCT).
        features: width of the per-point feature that is pooled.
        hidden: widths of the two hidden layers of each head.
        planes: M, the most planes that can be predicted.

    Raises:
        ValueError: naming the field that is below 1, or channels that 4 does not divide.
    """

    encoder: Encoder = Encoder.pct
    points: int = 1024
    channels: int = 128
    layers: int = 4
    features: int = 1024
    hidden: tuple[int, int] = (512, 256)
    planes: int = 13

    def __post_init__(self):
        object.__setattr__(self, "hidden", tuple(self.hidden))
        if len(self.hidden) != 2:
            raise ValueError(f"hidden is {list(self.hidden)}; two widths are needed")
        _at_least(self, 1, "points", "channels", "layers", "features", "planes")
        if min(self.hidden) < 1:
            raise ValueError(f"hidden is {list(self.hidden)}; widths must be at least 1")
        if self.channels % 4:
            raise ValueError(f"channels is {self.channels}; it must be a multiple of 4")


@dataclass(frozen=True)
class LossSettings:
    """Weights of the loss terms (Eq. 1 has them equal; SymmetryNet's reflection term is of R1 and R2 alone).

    Args:
        confidence, vector, centre, reflection: weights of Eq. 2, Eq. 3, Eq. 4 and SymmetryNet's reflection loss.
        foot: weight of the foot points' distances, ours: what keeps vectors from growing long under `reflection`.
        form: of Eq. 3.
        match_confidence: share of the heads' confidence in the cost of the assignment, so that equal heads keep apart.
        head_points: points of every cloud that the heads learn from in a step, drawn anew each time; None takes all.

    Raises:
        ValueError: for a negative weight, or where neither vector, reflection nor foot has one.
    """

    confidence: float = 1.0
    vector: float = 1.0
    centre: float = 1.0
    reflection: float = 0.0
    foot: float = 0.0
    form: VectorForm = VectorForm.squared
    match_confidence: float = 0.5
    head_points: int | None = None

    def __post_init__(self):
        for name in ("confidence", "vector", "centre", "reflection", "foot", "match_confidence"):
            if getattr(self, name) < 0:
                raise ValueError(f"loss.{name} is {getattr(self, name)}; it must not be negative")
        if not self.vector + self.reflection + self.foot:
            raise ValueError("loss.vector, loss.reflection and loss.foot are all 0; nothing would teach the normals")
        if self.head_points is not None:
            _at_least(self, 1, "head_points")


@dataclass(frozen=True)
class DecodeSettings:
    """From N·M predictions to planes (step 3 of figure 3).

    Args:
        confidence: predictions below it are dropped.
        eps_deg: predictions of normals closer than this are neighbours (DBSCAN).
        min_share: neighbours that make a core point, as a share of the points.
        cluster_points: points whose predictions are clustered; those of the others then join the nearest cluster.
        agreement_deg: a prediction that is this far from its cluster's axis adds 0.6 of its confidence to the plane's,
            which thus ranks planes that the points agree on before others.
        separation_deg: of two planes closer than this only the more confident one stays.

    Raises:
        ValueError: naming the field that is out of its range.
    """

    confidence: float = 0.3
    eps_deg: float = 3.0
    min_share: float = 0.1
    cluster_points: int = 128
    agreement_deg: float = 1.0
    separation_deg: float = 5.0

    def __post_init__(self):
        for name, most in (("confidence", 1.0), ("eps_deg", 90.0), ("min_share", 1.0), ("separation_deg", 90.0)):
            if not 0 <= getattr(self, name) <= most:
                raise ValueError(f"decode.{name} is {getattr(self, name)}; it must be between 0 and {most:g}")
        _at_least(self, 1, "cluster_points")
        if not self.agreement_deg > 0:
            raise ValueError(f"decode.agreement_deg is {self.agreement_deg}; it must be positive")


@dataclass(frozen=True)
class M1Settings(LearnedSettings):
    """All of M1.

    Args:
        network, loss, decode: see there.
        twice: let the network also see every cloud mirrored in y, whose planes are the mirrored ones. The track's
            shapes and poses are as likely one way as the other, and its errors are not the same. None is as the weights
            were judged, and no where there are none.
    """

    name: str = field(default="m1", metadata=HARMLESS)
    network: NetworkSettings = field(default_factory=NetworkSettings)
    loss: LossSettings = field(default_factory=LossSettings, metadata=HARMLESS)
    decode: DecodeSettings = field(default_factory=DecodeSettings)
    twice: bool | None = None


def _at_least(settings, least: int, *names: str) -> None:
    for name in names:
        if getattr(settings, name) < least:
            raise ValueError(f"{name} is {getattr(settings, name)}; it must be at least {least}")
