"""Reads the lines of a capture's text files."""

from __future__ import annotations

from pathlib import Path

from colonnade.common.errors import UserError
from colonnade.common.input_files import read_input, text_of
from colonnade.common.limits import MAX_CAPTURE_TEXT_BYTES, MAX_TEXT


def text_lines(file: Path, what: str, max_lines: int) -> list[str]:
    """The lines of a text file in UTF-8, with a mark of it or without, or in UTF-16.

    Args:
        file: In the folder of a capture.
        what: For messages, e.g. ``"the list"``.
        max_lines: Lines that it may have.

    Raises:
        UserError: The file is missing, too large, or has too many lines or too long ones.
    """
    text = text_of(read_input(file, what, MAX_CAPTURE_TEXT_BYTES, f"{file.parent} lacks {file.name}"))
    if text.count("\n") > max_lines:
        raise UserError(f"{file} has too many lines: {max_lines:,} at most")
    lines = text.split("\n")
    for number, line in enumerate(lines, 1):
        if len(line) > MAX_TEXT:
            raise UserError(f"{file}, line {number} has {len(line):,} characters: {MAX_TEXT:,} at most")
    return lines
