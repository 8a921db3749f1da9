"""Plain-text tables, printed row by row."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import groupby


@dataclass(frozen=True)
class Column:
    """One column of a table.

    Attributes:
        title: heading; a long title widens the column.
        width: characters; a longer cell shifts the rest of its row.
        form: format specification of the cells, such as ``,`` or ``.3f``.
        is_text: left-aligned.
        group: heading above adjacent columns of the same group.
    """

    title: str
    width: int
    form: str = ""
    is_text: bool = False
    group: str = ""

    @property
    def text_width(self) -> int:
        """Width of the printed column, characters."""
        return max(self.width, len(self.title))

    def align(self, text: str) -> str:
        """Pad the text to the column's width."""
        return text.ljust(self.text_width) if self.is_text else text.rjust(self.text_width)

    def cell(self, value: object) -> str:
        """Format one cell; None gives a dash."""
        return self.align("-" if value is None else format(value, self.form))


class Table:
    """A table of columns two spaces apart. The heading is printed with the first row, so not before an early error."""

    def __init__(self, columns: Sequence[Column], echo: Callable[[str], None] = print) -> None:
        """Create a table that prints its lines with `echo`."""
        self._columns = columns
        self._echo = echo
        self._is_begun = False

    def heading(self) -> str:
        """The line of titles, below a line of groups if there are groups."""
        lines = [_joined(column.align(column.title) for column in self._columns)]
        if any(column.group for column in self._columns):
            groups = [(name, list(members)) for name, members in groupby(self._columns, lambda column: column.group)]
            spans = (name.ljust(sum(member.text_width + 2 for member in members) - 2) for name, members in groups)
            lines.insert(0, _joined(spans))
        return "\n".join(lines)

    def print(self, *values: object) -> None:
        """Print a row: a value for each column."""
        if not self._is_begun:
            for line in self.heading().split("\n"):
                self._echo(line)
        self._is_begun = True
        self._echo(_joined(column.cell(value) for column, value in zip(self._columns, values, strict=True)))


def _joined(cells: Iterable[str]) -> str:
    return "  ".join(cells).rstrip()
