"""Long work shows itself: as bars on a terminal, as lines in a pipe; both on standard error."""

from __future__ import annotations

import contextlib
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import TYPE_CHECKING

from colonnade.common import processes
from colonnade.common.errors import UserError

if TYPE_CHECKING:
    from rich.progress import Progress as RichProgress

#: Reports the share of a step that is done, 0.0 to 1.0.
Report = Callable[[float], None]

#: Seconds until the first line in a pipe; the time to the next doubles, up to a limit.
FIRST_LINE = 10.0
LONGEST_SILENCE = 60.0

#: Seconds for which a step runs at least before a line names it.
SETTLING = 1.0

#: Steps at a time that a line has room for.
MAX_STEPS = 4


class Progress:
    """Steps of a piece of work. This base class shows nothing."""

    def step(self, title: str) -> AbstractContextManager[Report]:
        """Run one step, in any thread. What is yielded may be called with the share that is done, or never."""
        return contextlib.nullcontext(lambda share: None)

    def paused(self) -> AbstractContextManager[None]:
        """Nothing is shown meanwhile: other text may be printed."""
        return contextlib.nullcontext()

    def of(self, name: str) -> Progress:
        """The same, with `name` before each title: one of several pieces of work at a time."""
        return _Named(self, name)

    def note(self, text: str) -> None:
        """Print a line on standard error that is no error: what the user did not ask for and should know."""
        with self.paused():
            print(f"colonnade: {text}", file=sys.stderr, flush=True)


#: Shows nothing but notes.
QUIET = Progress()


class TerminalProgress(Progress):
    """Bars on standard error, one for each step that runs, gone when their steps are done."""

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self._running = 0
        self._display: RichProgress | None = None

    @contextlib.contextmanager
    def step(self, title: str) -> Iterator[Report]:
        """Show a bar for one step; it pulses until the first share is reported."""
        with self._lock:
            display = self._display = self._display or _display()
            self._running += 1
            display.start()
            task = display.add_task(title, total=None)
        try:
            yield lambda share: display.update(task, total=1.0, completed=share)
        finally:
            with self._lock:
                self._running -= 1
                display.remove_task(task)
                if self._running == 0:
                    display.stop()
                    self._display = None

    @contextlib.contextmanager
    def paused(self) -> Iterator[None]:
        """The bars make way; steps that begin or end meanwhile wait."""
        with self._lock:
            display = self._display
            if display is not None:
                display.stop()
            try:
                yield
            finally:
                if display is not None:
                    display.start()

    def close(self) -> None:
        """The terminal as it was, though steps may still run."""
        display = self._display
        if display is not None:
            display.stop()


@dataclass
class _Step:
    title: str
    begun: float
    share: float | None = None

    def text(self, now: float) -> str:
        share = "" if self.share is None else f"{100 * self.share:.0f} %, "
        return f"{self.title}: {share}{now - self.begun:.0f} s"


class LineProgress(Progress):
    """A line on standard error once steps have run for `FIRST_LINE` seconds, and then at growing intervals."""

    def __init__(self, first: float = FIRST_LINE) -> None:
        self._changed = threading.Condition()
        self._steps: list[_Step] = []
        self._watcher: threading.Thread | None = None
        self._interval = first
        self._due = 0.0

    @contextlib.contextmanager
    def step(self, title: str) -> Iterator[Report]:
        """Say so in the lines while the step runs, with its share and its seconds."""
        step = _Step(title, time.monotonic())

        def report(share: float) -> None:
            step.share = share

        with self._changed:
            self._steps.append(step)
            if self._watcher is None:
                self._due = max(self._due or step.begun + self._interval, step.begun + SETTLING)
                self._watcher = threading.Thread(target=self._watch, name="progress", daemon=True)
                self._watcher.start()
        try:
            yield report
        finally:
            with self._changed:
                self._steps.remove(step)

    @contextlib.contextmanager
    def paused(self) -> Iterator[None]:
        """No line is printed meanwhile."""
        with self._changed:
            yield

    def _watch(self) -> None:
        """Print what is due; end when nothing runs then, until the next step begins."""
        with self._changed:
            while (now := time.monotonic()) < self._due or self._steps:
                if now < self._due:
                    self._changed.wait(self._due - now)
                    continue
                self._print(now)
                self._interval = min(2 * self._interval, LONGEST_SILENCE)
                self._due = now + self._interval
            self._watcher = None

    def _print(self, now: float) -> None:
        texts = [step.text(now) for step in self._steps[:MAX_STEPS]]
        if len(self._steps) > MAX_STEPS:
            texts.append(f"{len(self._steps) - MAX_STEPS} more")
        # A reader that has gone is no reason to stop the work
        with contextlib.suppress(OSError, ValueError):
            print(f"colonnade: {'; '.join(texts)}", file=sys.stderr, flush=True)


class _Named(Progress):
    def __init__(self, whole: Progress, name: str) -> None:
        self._whole = whole
        self._name = name

    def step(self, title: str) -> AbstractContextManager[Report]:
        return self._whole.step(f"{self._name}: {title}")

    def paused(self) -> AbstractContextManager[None]:
        return self._whole.paused()


def _display() -> RichProgress:
    from rich.console import Console
    from rich.progress import BarColumn, Progress, SpinnerColumn, TaskProgressColumn, TextColumn, TimeElapsedColumn

    columns = (
        SpinnerColumn(),
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TaskProgressColumn(),
        TimeElapsedColumn(),
    )
    console = Console(stderr=True)
    return Progress(*columns, console=console, transient=True, redirect_stdout=False, redirect_stderr=False)


def for_terminal() -> Progress:
    """Bars where standard error is a terminal, lines elsewhere; nothing with ``COLONNADE_PROGRESS=off``."""
    chosen = os.environ.get("COLONNADE_PROGRESS", "on")
    if chosen not in ("on", "off"):
        raise UserError(f"COLONNADE_PROGRESS={chosen} is neither on nor off")
    if chosen == "off":
        return QUIET
    if not sys.stderr.isatty():
        return LineProgress()
    bars = TerminalProgress()
    processes.when_leaving(bars.close)
    return bars
