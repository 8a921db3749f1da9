"""Notes on an input: what it holds and a result will not show, or what was repaired.

The command line opens a block that shows them as lines on standard error; with ``--strict`` they are an error. Outside
of such a block, as in a program that uses the packages, they are silent, and found at the object that they concern.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

from colonnade.common.errors import UserError


@dataclass
class Notes:
    """The notes of one command.

    Attributes:
        show: Shows a line.
        is_strict: Notes are errors.
        shown: Lines shown so far; each is shown once.
    """

    show: Callable[[str], None]
    is_strict: bool = False
    shown: set[str] = field(default_factory=set)


_current: Notes | None = None


@contextlib.contextmanager
def opened(show: Callable[[str], None]) -> Iterator[None]:
    """Show the notes of the block, in all threads."""
    global _current
    before, _current = _current, Notes(show)
    try:
        yield
    finally:
        _current = before


def be_strict() -> None:
    """Make the notes of the current command errors."""
    if _current is not None:
        _current.is_strict = True


def report(lines: Sequence[str]) -> None:
    """Show lines that were not yet shown.

    Raises:
        UserError: The command is strict, and there is a line.
    """
    if _current is None or not lines:
        return
    if _current.is_strict:
        raise UserError(f"{'; '.join(lines)} (--strict)")
    for line in lines:
        if line not in _current.shown:
            _current.shown.add(line)
            _current.show(line)
