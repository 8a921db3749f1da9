"""Runs the jobs of a study in the order of their dependencies, and says how far it is."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable, Iterable
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path

from colonnade.common.progress import QUIET, Progress

from colonnade_lab.explore import jobs
from colonnade_lab.explore.jobs import Job, JobFailed, content_of
from colonnade_lab.explore.runners import Runner

#: Seconds until the first line of progress. The interval then doubles up to the maximum.
FIRST_LINE = 10.0
MAX_INTERVAL = 60.0

#: Seconds of a job of each kind, until one of its kind has been measured.
EXPECTED = {
    "reference": 5.0,
    "picture": 8.0,
    "comparison": 5.0,
    "cycles": 90.0,
    "counted": 6.0,
    "area": 200.0,
    "power": 150.0,
}

#: The folder of a job's result, or the reason why there is none.
Outcome = Path | JobFailed


@dataclass
class Tally:
    """How many jobs were done, and how."""

    run: int = 0
    cached: int = 0
    failed: int = 0
    seconds: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))

    def expected(self, kind: str) -> float:
        """Seconds of a job of this kind."""
        measured = self.seconds[kind]
        return sum(measured) / len(measured) if measured else EXPECTED[kind]


class Schedule:
    """The outcomes of all jobs so far. A search adds jobs in batches."""

    def __init__(self, runner: Runner, progress: Progress = QUIET, title: str = "exploring") -> None:
        self.outcomes: dict[str, Outcome] = {}
        self.tally = Tally()
        self._runner = runner
        self._progress = progress
        self._title = title
        self._interval = FIRST_LINE
        self._due = time.monotonic() + FIRST_LINE
        self._waits: set[str] = set()

    def run(self, batch: Iterable[Job], finished: Callable[[Job, Outcome], None] = lambda job, outcome: None) -> None:
        """Run jobs to their end; equal jobs run once. A failed job fails jobs that read its result."""
        left = {job.key: job for job in batch if job.key not in self.outcomes}
        total = len(left)
        running: dict[Future[dict[str, bytes]], tuple[Job, float, ExitStack]] = {}

        def end(job: Job, outcome: Outcome) -> None:
            self.outcomes[job.key] = outcome
            self.tally.failed += isinstance(outcome, JobFailed)
            finished(job, outcome)
            if isinstance(outcome, JobFailed):
                self._progress.note(f"{job.title} failed: {outcome}")

        with self._progress.step(self._title) as report:
            try:
                while left or running:
                    before = len(left)
                    self._start(left, running, end)
                    report(1 - (len(left) + len(running)) / total if total else 1.0)
                    if not running:
                        if len(left) == before:
                            raise RuntimeError(f"{next(iter(left.values())).title} waits for a job that is not there")
                        continue
                    done, _ = wait(running, timeout=FIRST_LINE, return_when=FIRST_COMPLETED)
                    for future in done:
                        job, begun, shown = running.pop(future)
                        shown.close()
                        end(job, self._outcome(job, future, time.monotonic() - begun))
                    self._say(left, [job for job, _, _ in running.values()])
            finally:
                for _, _, shown in running.values():
                    shown.close()

    def _start(
        self,
        left: dict[str, Job],
        running: dict[Future[dict[str, bytes]], tuple[Job, float, ExitStack]],
        end: Callable[[Job, Outcome], None],
    ) -> None:
        """Start the jobs whose inputs are there and that have a place; long ones first."""
        for job in sorted(left.values(), key=lambda job: -EXPECTED[job.kind.name]):
            if any(key in left or key in (other.key for other, _, _ in running.values()) for key in job.after):
                continue
            if not all(key in self.outcomes for key in job.inputs):
                continue
            found = [self.outcomes[key] for key in job.inputs]
            folders = [outcome for outcome in found if isinstance(outcome, Path)]
            if len(folders) < len(found):
                del left[job.key]
                end(job, next(outcome for outcome in found if isinstance(outcome, JobFailed)))
            elif (kept := jobs.cached(job)) is not None:
                del left[job.key]
                self.tally.cached += 1
                end(job, kept)
            elif self._runner.has_place(job, [other for other, _, _ in running.values()]):
                self._warn(job)
                del left[job.key]
                shown = ExitStack()
                shown.enter_context(self._progress.step(job.title))
                future = self._runner.submit(job, tuple(content_of(folder) for folder in folders))
                running[future] = (job, time.monotonic(), shown)

    def _outcome(self, job: Job, future: Future[dict[str, bytes]], seconds: float) -> Outcome:
        try:
            content = future.result()
        except JobFailed as failure:
            return failure
        except Exception as error:  # a lost worker, or an error of the runner
            return JobFailed(f"{type(error).__name__}: {' '.join(str(error).split())}")
        self.tally.run += 1
        self.tally.seconds[job.kind.name].append(seconds)
        return jobs.keep(job, content)

    def _warn(self, job: Job) -> None:
        """Say once for each kind that no worker can run it yet."""
        if job.kind.name not in self._waits and (reason := self._runner.missing(job)) is not None:
            self._waits.add(job.kind.name)
            self._progress.note(reason)

    def _say(self, left: dict[str, Job], running: list[Job]) -> None:
        now = time.monotonic()
        if now < self._due or not running or self._progress is QUIET:
            return
        self._interval = min(2 * self._interval, MAX_INTERVAL)
        self._due = now + self._interval
        ahead = sum(self.tally.expected(job.kind.name) for job in left.values())
        ahead += sum(self.tally.expected(job.kind.name) / 2 for job in running)
        done = self.tally.run + self.tally.cached
        failed = f", {self.tally.failed} failed" if self.tally.failed else ""
        state = f"{len(running)} {self._runner.state}, {len(left)} left"
        time_left = _duration(ahead / self._runner.parallel)
        self._progress.note(f"{done} jobs done ({self.tally.cached} from the cache{failed}), {state}, {time_left}")


def _duration(seconds: float) -> str:
    return f"about {seconds:.0f} s" if seconds < 90 else f"about {seconds / 60:.0f} min"
