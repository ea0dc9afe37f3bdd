"""How far all rows of the tables have come: which of how many, and the time left, on a terminal and in a log alike."""

import json
import time
from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from lightning import Callback
from omegaconf import DictConfig
from tqdm import tqdm

from symshrec.files.threads import one_thread
from symshrec.runs.evaluate import METRICS, TIMES, clouds_left, datamodule_of, evaluate, seconds_in
from symshrec.runs.provenance import hardware
from symshrec.runs.reproduce import Row
from symshrec.runs.stores import PREDICTIONS

LINE_EVERY = 300.0  # seconds, within a row: a log of hours shows that it goes on
TRUSTED = 0.1  # of the expected time: so much weight has it beside what this session has taken so far


@dataclass(frozen=True)
class Job:
    """A row to run: clouds still to detect on, and seconds expected for each, as measured before; None if never."""

    row: Row
    config: DictConfig
    clouds: int
    seconds: float | None
    measured_on: str = ""


def jobs_of(rows: Sequence[Row], overrides: Sequence[str], folders: Sequence[str | PathLike] = ()) -> list[Job]:
    """Every row as a job, in the order given; those that are up to date have no clouds left.

    Raises:
        ValueError: for a row that cannot be run as configured; before any has run.
    """
    jobs, opened = [], {}
    for row in rows:
        config = row.config(overrides, folders)
        config.trainer.enable_progress_bar = False  # there is one for the whole
        if row.data not in opened:
            opened[row.data] = datamodule_of(config)
        clouds = clouds_left(config, opened[row.data])
        seconds, machine = measured_before(config) if clouds else (None, "")
        jobs.append(Job(row, config, clouds, seconds, machine))
    return jobs


def measured_before(config: DictConfig) -> tuple[float | None, str]:
    """Seconds that a cloud of this row took, and where: earlier in this folder, as published, or on other data."""
    runs, results, name = Path(config.paths.runs), Path(config.paths.results), config.name
    published = results / f"{config.data.name}{config.data.variant}" / name
    places = (Path(config.folder), published, *sorted(runs.glob(f"*/{name}")), *sorted(results.glob(f"*/{name}")))
    for place in places:
        taken, machine = seconds_in(place / PREDICTIONS / TIMES), "this machine"
        if not taken["detected_clouds"]:
            try:
                found = json.loads((place / METRICS).read_text(encoding="utf-8"))
                taken, there = found["seconds"], found["hardware"]
                if there != hardware():
                    machine = f"{there['cpu']}, {there['cores']} cores"
            except (OSError, ValueError, KeyError, TypeError):
                continue
        if taken["detected_clouds"]:
            return taken["wall"] / taken["detected_clouds"], machine
    return None, ""


class Progress(Callback):
    """Runs jobs one after the other, with a line for each and one bar for all of them.

    Where the seconds of some rows are not known, clouds of these count as those of the others do on average.
    """

    def __init__(self, jobs: Sequence[Job]):
        self.jobs = jobs
        known = [(job.clouds, job.seconds) for job in jobs if job.seconds is not None]
        clouds = sum(each for each, _ in known)
        self.usual = sum(each * seconds for each, seconds in known) / clouds if clouds else 1.0
        self.total = sum(map(self._expected, jobs))
        self.known, self.done, self.before = bool(clouds), 0.0, 0.0
        self.began = self.said = time.monotonic()

    def __enter__(self) -> "Progress":
        shape = "{desc} |{bar}| {elapsed}, {postfix}"
        self.bar = tqdm(total=self.total, bar_format=shape, disable=None, leave=False)
        return self

    def __exit__(self, *error) -> None:
        self.bar.close()

    def run(self) -> None:
        """Run every job that has clouds left; errors as `evaluate`."""
        to_run = [job for job in self.jobs if job.clouds]
        shared: tuple[str, str] | None = None
        shelf: dict = {}
        self._say(self._beginning(to_run))
        self.began = self.said = time.monotonic()
        for number, job in enumerate(self.jobs, 1):
            if not job.clouds:
                continue
            started = time.monotonic()
            self.job, self.place = job, f"{number:{len(str(len(self.jobs)))}} of {len(self.jobs)}"
            self.bar.set_description(f"{self.place}, {job.row.data}, {job.config.title}", refresh=False)
            if (of := (job.row.data, job.config.method.name)) != shared:
                shared, shelf = of, {}  # runs of one method stand together, and what they share takes memory
            with one_thread():  # networks as small as these lose little, and everything where other programs compute
                result = evaluate(job.config, callbacks=[self], shelf=shelf)
            self.before += self._expected(job)
            self._move_to(self.before)
            took = duration(time.monotonic() - started)
            left = f"; {self.left()} left" if job is not to_run[-1] else ""
            self._say(f"{self.place}  {job.row.data}, {job.config.title}: {_score(result)}{took}{left}")

    def on_test_batch_end(self, trainer, method, outputs, batch, batch_idx, dataloader_idx=0) -> None:
        """Count the clouds of the batch that were not known before."""
        clouds = sum(position not in method.known for position in batch.positions)
        self._move_to(min(self.done + clouds * self._expected(self.job) / self.job.clouds, self.total))
        if time.monotonic() - self.said > LINE_EVERY:
            share = (self.done - self.before) / self._expected(self.job)
            self._say(f"{self.place}  {self.job.row.data}, {self.job.config.title}: {share:.0%}; {self.left()} left")

    def left(self) -> str:
        """The time left: the seconds known before, at a pace that this session's own takes over bit by bit."""
        spent, left = time.monotonic() - self.began, self.total - self.done
        trusted = TRUSTED * self.total if self.known else 0.0
        if not trusted + self.done:
            return "unknown time"
        return f"about {duration(left * (spent + trusted) / (self.done + trusted))}"

    def _beginning(self, to_run: Sequence[Job]) -> str:
        current = len(self.jobs) - len(to_run)
        told = f"{len(self.jobs)} rows: {current} up to date, {len(to_run)} to run"
        if not to_run or not self.known:
            return told
        machines = " and ".join(dict.fromkeys(job.measured_on for job in to_run if job.measured_on))
        return f"{told}, about {duration(self.total)} by the seconds that a cloud took on {machines}"

    def _expected(self, job: Job) -> float:
        return job.clouds * (self.usual if job.seconds is None else job.seconds)

    def _move_to(self, done: float) -> None:
        self.bar.set_postfix_str(f"{self.left()} left", refresh=False)
        self.bar.update(done - self.done)
        self.done = done

    def _say(self, text: str) -> None:
        tqdm.write(text)
        self.said = time.monotonic()


def duration(seconds: float) -> str:
    """A time to read: 8 s, 12 min, 3.4 h.

    >>> [duration(each) for each in (0.2, 59.6, 200, 12_240)]
    ['1 s', '60 s', '3 min', '3.4 h']
    """
    if seconds < 100:
        return f"{max(round(seconds), 1)} s"
    return f"{seconds / 60:.0f} min" if seconds < 6000 else f"{seconds / 3600:.1f} h"


def _score(result: dict) -> str:
    """The mAP over all clouds, at the first tolerances that the run was scored at."""
    for score in result["scores"]:
        if (score["metric"], score["group"]) == ("mAP", "all"):
            return f"mAP {score['value']:.4f}, {result['data']['clouds']} clouds, "
    return ""
