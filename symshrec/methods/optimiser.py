"""How a network is trained, as settings. No torch here: the schema of conf/ is made of these."""

import math
from dataclasses import dataclass


@dataclass
class OptimiserSettings:
    """AdamW on a linear rise and a cosine fall of the learning rate.

    Args:
        learning_rate: its peak. weight_decay: of AdamW. warmup: share of the steps that it rises.
        clip: largest norm of the gradient.

    Raises:
        ValueError: naming the field that is out of its range.
    """

    learning_rate: float = 2e-3
    weight_decay: float = 1e-4
    warmup: float = 0.1
    clip: float = 1.0

    def __post_init__(self):
        for name in ("learning_rate", "clip"):
            if not getattr(self, name) > 0:
                raise ValueError(f"train.optimiser.{name} is {getattr(self, name)}; it must be positive")
        if self.weight_decay < 0 or not 0 <= self.warmup < 1:
            raise ValueError(
                f"train.optimiser has weight_decay {self.weight_decay} and warmup {self.warmup}; they must be at least "
                "0, and warmup below 1"
            )

    def factor(self, step: int, steps: int) -> float:
        """Of the peak, the learning rate at `step` of `steps`."""
        rise = max(1, round(self.warmup * steps))
        if step < rise:
            return (step + 1) / rise
        return 0.5 * (1 + math.cos(math.pi * min(1.0, (step - rise) / max(1, steps - rise))))
