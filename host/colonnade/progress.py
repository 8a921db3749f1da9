"""Long work shows itself on a terminal and stays quiet in a pipe."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.progress import Progress as RichProgress

#: Reports the share of a step that is done, 0.0 to 1.0.
Report = Callable[[float], None]


class Progress:
    """Steps of a piece of work. This base class shows nothing."""

    @contextlib.contextmanager
    def step(self, title: str) -> Iterator[Report]:
        """Run one step. What is yielded may be called with the share that is done, or never."""
        yield lambda share: None


#: Shows nothing.
QUIET = Progress()


class TerminalProgress(Progress):
    """Bars on standard error, gone when their step is done."""

    @contextlib.contextmanager
    def step(self, title: str) -> Iterator[Report]:
        """Show a bar for one step; it pulses until the first share is reported."""
        display = _display()
        with display:
            task = display.add_task(title, total=None)
            yield lambda share: display.update(task, total=1.0, completed=share)


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
    return Progress(*columns, console=Console(stderr=True), transient=True)


def for_terminal() -> Progress:
    """Bars where standard error is a terminal, nothing elsewhere."""
    return TerminalProgress() if sys.stderr.isatty() else QUIET
