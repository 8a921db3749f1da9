"""Makes text from files and arguments safe for a terminal: one line, no control characters, limited length."""

from __future__ import annotations

import difflib
from collections.abc import Sequence

from colonnade.common.limits import MAX_MESSAGE, MAX_WORD


def plain(text: str) -> str:
    """Escape all characters but printable ones, e.g. ESC as ``\\x1b``: a name in a line cannot start another one."""
    if text.isprintable():
        return text
    return "".join(char if char.isprintable() else _escaped(char) for char in text)


def listed(names: Sequence[str], maximum: int = 240) -> str:
    """Names in a line, of at most so many characters, and the number of names that are left out."""
    words: list[str] = []
    length = 0
    for name in names:
        word = _shortened(plain(name), MAX_WORD)
        length += len(word) + 2
        if words and length > maximum:
            return f"{', '.join(words)} and {len(names) - len(words):,} more"
        words.append(word)
    return ", ".join(words)


def meant(name: str, known: Sequence[str]) -> str | None:
    """The known name that is nearest to another one, whatever its case, or begins with it; None: none is near."""
    folded = {one.casefold(): one for one in sorted(known, key=len, reverse=True)}
    near = difflib.get_close_matches(name.casefold(), folded, 1)
    near = [one for one in sorted(folded) if name and one.startswith(name.casefold())][:1] or near
    return folded[near[0]] if near else None


def one_line(text: str) -> str:
    """Format a message: one line, control characters escaped, long words and long messages shortened."""
    words = (_shortened(plain(word), MAX_WORD) for word in text.split())
    return _shortened(" ".join(words), MAX_MESSAGE)


def _shortened(text: str, maximum: int) -> str:
    """Keep the start and the end of a text longer than ``maximum`` characters."""
    if len(text) <= maximum:
        return text
    return f"{text[: maximum * 2 // 3]}…{text[-maximum // 4 :]}"


def _escaped(char: str) -> str:
    code = ord(char)
    if 0xDC80 <= code <= 0xDCFF:  # a byte of a file name that is not UTF-8
        return f"\\x{code - 0xDC00:02x}"
    return char.encode("unicode_escape", "backslashreplace").decode("ascii")
