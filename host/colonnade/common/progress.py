"""Progress display of long work on standard error: bars on a terminal, lines in a pipe."""

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

#: Reports the completed fraction of a step, 0.0 to 1.0.
Report = Callable[[float], None]

#: Seconds until the first line in a pipe. The interval then doubles up to the maximum.
FIRST_LINE = 10.0
MAX_INTERVAL = 60.0

#: Seconds that a step runs before a line names it.
MIN_STEP_SECONDS = 1.0

#: Steps that a line names at most.
MAX_STEPS = 4


class Progress:
    """Displays the steps of a task. This base class shows nothing."""

    def step(self, title: str) -> AbstractContextManager[Report]:
        """Run one step, in any thread. The block may call the yielded function with the completed fraction."""
        return contextlib.nullcontext(lambda fraction: None)

    def paused(self) -> AbstractContextManager[None]:
        """Hide the display in the block, so that other text can be printed."""
        return contextlib.nullcontext()

    def of(self, name: str) -> Progress:
        """The same display with `name` before each title, for one of several parallel tasks."""
        return _Named(self, name)

    def note(self, text: str) -> None:
        """Print a line on standard error that is not an error, e.g. a damaged cache entry."""
        with self.paused():
            print(f"colonnade: {text}", file=sys.stderr, flush=True)


#: Shows nothing but notes.
QUIET = Progress()
_of_command: Progress = QUIET


def hidden() -> AbstractContextManager[None]:
    """Hide the display of the command in the block, so that other text can be printed."""
    return _of_command.paused()


class TerminalProgress(Progress):
    """One bar on standard error for each running step."""

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self._running = 0
        self._display: RichProgress | None = None

    @contextlib.contextmanager
    def step(self, title: str) -> Iterator[Report]:
        """Show a bar for one step; it pulses until the first report."""
        with self._lock:
            display = self._display = self._display or _display()
            self._running += 1
            display.start()
            task = display.add_task(title, total=None)
        try:
            yield lambda fraction: display.update(task, total=1.0, completed=fraction)
        finally:
            with self._lock:
                self._running -= 1
                display.remove_task(task)
                if self._running == 0:
                    display.stop()
                    self._display = None

    @contextlib.contextmanager
    def paused(self) -> Iterator[None]:
        """Hide the bars in the block; steps that begin or end in other threads wait."""
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
        """Restore the terminal; steps may still run."""
        display = self._display
        if display is not None:
            display.stop()


@dataclass
class _Step:
    title: str
    begun: float
    fraction: float | None = None

    def text(self, now: float) -> str:
        percentage = "" if self.fraction is None else f"{100 * self.fraction:.0f} %, "
        return f"{self.title}: {percentage}{now - self.begun:.0f} s"


class LineProgress(Progress):
    """Lines on standard error: the first after `FIRST_LINE` seconds, then at growing intervals."""

    def __init__(self, first: float = FIRST_LINE) -> None:
        self._changed = threading.Condition()
        self._steps: list[_Step] = []
        self._watcher: threading.Thread | None = None
        self._interval = first
        self._due = 0.0

    @contextlib.contextmanager
    def step(self, title: str) -> Iterator[Report]:
        """Name the step in the lines while it runs, with its completed fraction and its seconds."""
        step = _Step(title, time.monotonic())

        def report(fraction: float) -> None:
            step.fraction = fraction

        with self._changed:
            self._steps.append(step)
            if self._watcher is None:
                self._due = max(self._due or step.begun + self._interval, step.begun + MIN_STEP_SECONDS)
                self._watcher = threading.Thread(target=self._watch, name="progress", daemon=True)
                self._watcher.start()
        try:
            yield report
        finally:
            with self._changed:
                self._steps.remove(step)

    @contextlib.contextmanager
    def paused(self) -> Iterator[None]:
        """Print no line in the block."""
        with self._changed:
            yield

    def _watch(self) -> None:
        """Print lines when due. The thread ends when no step runs; the next step starts another one."""
        with self._changed:
            while (now := time.monotonic()) < self._due or self._steps:
                if now < self._due:
                    self._changed.wait(self._due - now)
                    continue
                self._print(now)
                self._interval = min(2 * self._interval, MAX_INTERVAL)
                self._due = now + self._interval
            self._watcher = None

    def _print(self, now: float) -> None:
        texts = [step.text(now) for step in self._steps[:MAX_STEPS]]
        if len(self._steps) > MAX_STEPS:
            texts.append(f"{len(self._steps) - MAX_STEPS} more")
        # A closed pipe must not stop the work
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
    """Bars if standard error is a terminal, else lines; nothing with ``COLONNADE_PROGRESS=off``.

    It is the display of the command, for `hidden`.
    """
    global _of_command
    _of_command = _chosen()
    return _of_command


def _chosen() -> Progress:
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
