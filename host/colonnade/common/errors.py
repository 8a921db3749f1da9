"""The one exception for errors that the user can fix."""

from __future__ import annotations

from colonnade.common.terminal_text import one_line


class UserError(Exception):
    """Wrong input, or something missing on this machine.

    The message is one line: the problem, its place and the fix. The command line prints it after
    ``colonnade: error:`` and exits with status 2. Control characters are escaped, long words are shortened.
    """

    def __init__(self, message: str) -> None:
        super().__init__(one_line(message))


def reason_of(error: OSError) -> str:
    """The operating system's reason, as text."""
    return error.strerror or str(error) or type(error).__name__
