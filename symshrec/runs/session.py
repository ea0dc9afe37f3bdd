"""What watches over one session of a training: its counts, its checkpoints, and its end when its time is over."""

import math
import time
from pathlib import Path

from lightning import Callback
from lightning.pytorch.callbacks import Checkpoint

ASK_EVERY = 10  # batches between questions to all processes of a training


class TimeIsUp(Exception):
    """Ends a session between two batches of a round; its checkpoint is written."""


class Progress(Callback):
    """Counts clouds, seconds, and the share of them that steps waited for data, over all sessions of a training."""

    def __init__(self):
        self.clouds, self.seconds, self.waited = 0, 0.0, 0.0
        self._end = 0.0

    def state_dict(self) -> dict[str, float]:
        return {"clouds": self.clouds, "seconds": self.seconds, "waited": self.waited}

    def load_state_dict(self, state: dict[str, float]) -> None:
        self.clouds, self.seconds, self.waited = state["clouds"], state["seconds"], state["waited"]

    def on_train_start(self, trainer, method) -> None:
        self._end = time.perf_counter()  # within a round no epoch starts

    def on_train_epoch_start(self, trainer, method) -> None:
        self._end = time.perf_counter()

    def on_train_batch_start(self, trainer, method, batch, batch_idx) -> None:
        now = time.perf_counter()
        self.waited += now - self._end
        self.seconds += now - self._end
        self._end = now

    def on_train_batch_end(self, trainer, method, outputs, batch, batch_idx) -> None:
        now = time.perf_counter()
        self.seconds += now - self._end
        self._end = now
        self.clouds += len(batch) * trainer.world_size

    def on_train_epoch_end(self, trainer, method) -> None:
        shares = {"clouds_per_second": self.clouds, "share_waiting_for_data": self.waited}
        seconds = max(self.seconds, 1e-9)
        method.log_dict({f"train/{name}": value / seconds for name, value in shares.items()}, sync_dist=True)


class TimedCheckpoints(Checkpoint):
    """Writes `path` after every round and, so that no kill costs more than a few minutes, between its batches.

    What comes next depends on the number of steps alone (`RoundSampler`, `LearnedMethod.training_step`), so a training
    goes on from any of these checkpoints to the same weights. Before a round's last batch, after which the validation
    may take its time, half of the minutes are enough. Lightning calls this after all other callbacks.

    Args:
        minutes: between checkpoints.
        max_minutes: of this session, which then ends after the batch in hand. None sets no limit.
    """

    def __init__(self, path: Path, minutes: float, max_minutes: float | None):
        self.path, self.interval = path, 60 * minutes
        self._saved = time.perf_counter()
        self._stop = math.inf if max_minutes is None else self._saved + 60 * max_minutes

    def on_train_start(self, trainer, method) -> None:
        self._saved = time.perf_counter()

    def on_train_batch_end(self, trainer, method, outputs, batch, batch_idx) -> None:
        left = trainer.num_training_batches - batch_idx - 1
        within_a_step = (batch_idx + 1) % trainer.accumulate_grad_batches
        if not left or within_a_step or (trainer.world_size > 1 and left > 1 and left % ASK_EVERY):
            return
        now = time.perf_counter()
        due = now - self._saved >= self.interval / (2 if left == 1 else 1)
        due, over = trainer.strategy.broadcast((due, now > self._stop))
        if due or over:
            self._save(trainer)
        if over:
            raise TimeIsUp

    def on_train_epoch_end(self, trainer, method) -> None:
        self._save(trainer)
        trainer.should_stop = trainer.strategy.broadcast(time.perf_counter() > self._stop)

    def _save(self, trainer) -> None:
        trainer.save_checkpoint(self.path)
        self._saved = time.perf_counter()
