"""Long work shows itself on a terminal and stays quiet in a pipe."""

from __future__ import annotations

import contextlib
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.progress import Progress as RichProgress

#: Reports the share of a step that is done, 0.0 to 1.0.
Report = Callable[[float], None]


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
        return self


#: Shows nothing.
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

    def of(self, name: str) -> Progress:
        """The same bars, with `name` before each title."""
        return _Named(self, name)


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
        TextColumn("{task.description}"),
        BarColumn(),
        TaskProgressColumn(),
        TimeElapsedColumn(),
    )
    console = Console(stderr=True)
    return Progress(*columns, console=console, transient=True, redirect_stdout=False, redirect_stderr=False)


def for_terminal() -> Progress:
    """Bars where standard error is a terminal, nothing elsewhere."""
    return TerminalProgress() if sys.stderr.isatty() else QUIET
