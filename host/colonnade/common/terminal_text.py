"""Text from files and arguments, fit for a terminal: no control characters, no more than a few lines."""

from __future__ import annotations

from colonnade.common.limits import MAX_MESSAGE, MAX_WORD


def plain(text: str) -> str:
    """The text with all but printable characters and line ends escaped: ``\\x1b`` for an escape character."""
    if text.isprintable():
        return text
    return "".join(char if char.isprintable() or char == "\n" else _escaped(char) for char in text)


def one_line(text: str) -> str:
    """The text for a message: on one line, plain, with long words and long messages shortened."""
    words = (_shortened(plain(word), MAX_WORD) for word in text.split())
    return _shortened(" ".join(words), MAX_MESSAGE)


def _shortened(text: str, maximum: int) -> str:
    """The begin and the end of a text that is longer than ``most`` characters."""
    if len(text) <= maximum:
        return text
    return f"{text[: maximum * 2 // 3]}…{text[-maximum // 4 :]}"


def _escaped(char: str) -> str:
    code = ord(char)
    if 0xDC80 <= code <= 0xDCFF:  # a byte of a file name that is not UTF-8
        return f"\\x{code - 0xDC00:02x}"
    return char.encode("unicode_escape", "backslashreplace").decode("ascii")
