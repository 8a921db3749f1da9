"""The one exception for errors that the user can fix."""

from __future__ import annotations

from colonnade.common.terminal_text import one_line


class UserError(Exception):
    """Wrong input, or something missing on this machine.

    The message is one line: what is wrong, where, and what to do. The command line prints it after
    ``colonnade: error:`` and ends with exit status 2. Control characters are escaped, overlong names are shortened.
    """

    def __init__(self, message: str) -> None:
        super().__init__(one_line(message))


def reason_of(error: OSError) -> str:
    """Why the system refused, in words."""
    return error.strerror or str(error) or type(error).__name__
