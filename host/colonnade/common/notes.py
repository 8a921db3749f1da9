"""Notes on an input: what it holds and a result will not show, what was repaired, or what was chosen for it.

The command line opens a block that shows them as lines on standard error; with ``--strict`` the ones of `report` are an
error. Outside of such a block, as in a program that uses the packages, they are silent, and found at the object that
they concern.
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
        lines: Those so far; each is shown once.
        subject, parts: A line that is not yet complete: what it is on, and its parts.
    """

    show: Callable[[str], None]
    is_strict: bool = False
    lines: set[str] = field(default_factory=set)
    subject: str = ""
    parts: list[str] = field(default_factory=list)


_current: Notes | None = None


@contextlib.contextmanager
def opened(show: Callable[[str], None], earlier: set[str] | None = None) -> Iterator[None]:
    """Show the notes of the block, in all threads.

    Args:
        show: Shows a line.
        earlier: Lines of earlier blocks, which are left out; this block's are added.
    """
    global _current
    before, _current = _current, Notes(show, lines=set() if earlier is None else earlier)
    try:
        yield
    finally:
        flush()
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
    if _current is not None and _current.is_strict and lines:
        raise UserError(f"{'; '.join(lines)} (--strict)")
    for line in lines:
        tell(line)


def tell(line: str) -> None:
    """Show a line on what was chosen, unless it was shown before; no error of a strict command."""
    if _current is not None and line not in _current.lines:
        _current.lines.add(line)
        _current.show(line)


def add(subject: str, what: str, words: str) -> None:
    """Add words to the line on a subject; of each kind, which ``what`` names, the first ones of a command are shown.

    `flush`, the end of the block, and words on another subject complete the line.
    """
    if _current is None or (kind := f"{subject}: {what}") in _current.lines:
        return
    if subject != _current.subject:
        flush()
    _current.lines.add(kind)
    _current.subject = subject
    _current.parts.append(words)


def flush() -> None:
    """Show the line of `add`, if there is one."""
    if _current is not None and _current.parts:
        line, _current.parts = f"{_current.subject}: {'; '.join(_current.parts)}", []
        _current.show(line)
