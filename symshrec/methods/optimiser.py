"""How a network is trained, as settings. No torch here: the schema of conf/ is made of these."""

import math
from dataclasses import dataclass
from enum import Enum


class Schedule(Enum):
    """How the learning rate goes over a training, after its linear rise.

    cosine: falls to zero at the end, whose place must be known. constant: stays, so that the training can be ended, or
    go on, wherever it stands; a cool-down from any of its checkpoints then brings the rate to zero (the warm-up,
    stable, decay schedule; Hu et al. 2024, Hägele et al. 2024).
    """

    cosine = "cosine"
    constant = "constant"


@dataclass
class OptimiserSettings:
    """AdamW, and how its learning rate goes.

    Args:
        learning_rate: its peak. weight_decay: of AdamW. clip: largest norm of the gradient.
        schedule: see `Schedule`.
        warmup: share of the steps over which a cosine's rate rises. warmup_steps: of a constant one.

    Raises:
        ValueError: naming the field that is out of its range.
    """

    learning_rate: float = 2e-3
    weight_decay: float = 1e-4
    warmup: float = 0.1
    clip: float = 1.0
    schedule: Schedule = Schedule.cosine
    warmup_steps: int = 1000

    def __post_init__(self):
        for name in ("learning_rate", "clip"):
            if not getattr(self, name) > 0:
                raise ValueError(f"train.optimiser.{name} is {getattr(self, name)}; it must be positive")
        if self.warmup_steps < 1:
            raise ValueError(f"train.optimiser.warmup_steps is {self.warmup_steps}; it must be at least 1")
        if self.weight_decay < 0 or not 0 <= self.warmup < 1:
            raise ValueError(
                f"train.optimiser has weight_decay {self.weight_decay} and warmup {self.warmup}; they must be at least "
                "0, and warmup below 1"
            )

    def factor(self, step: int, steps: int, cooldown_from: int | None = None) -> float:
        """Of the peak, the learning rate at `step` of `steps`.

        A cool-down from step c falls as 1 − √((step − c)/(steps − c)) (Hägele et al. 2024).
        """
        if self.schedule is Schedule.constant:
            rise = min(1.0, (step + 1) / self.warmup_steps)
            if cooldown_from is None or step < cooldown_from:
                return rise
            return rise * (1 - math.sqrt(min(1.0, (step - cooldown_from) / max(1, steps - cooldown_from))))
        rise = max(1, round(self.warmup * steps))
        if step < rise:
            return (step + 1) / rise
        return 0.5 * (1 + math.cos(math.pi * min(1.0, (step - rise) / max(1, steps - rise))))
