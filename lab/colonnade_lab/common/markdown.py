"""Tables in Markdown, for generated pages."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

#: A cell that begins with a number, or has none.
_NUMBER = re.compile(r"\**[+−-]?\d.*|[–\s]*", re.DOTALL)


def markdown(titles: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Format a table; columns of numbers are right-aligned, the first column and those with text are left-aligned."""
    cells = [list(row) for row in rows]
    are_numbers = [all(_NUMBER.fullmatch(row[index]) for row in cells) for index in range(1, len(titles))]
    rule = ["---", *("---:" if is_number else "---" for is_number in are_numbers)]
    return "\n".join(f"|{'|'.join(line)}|" for line in (titles, rule, *cells))
