"""Imported first by the Python programs of this folder: `-h` and `--help` print the program's docstring."""

from __future__ import annotations

import sys
from typing import NoReturn


def refuse(*notes: str) -> NoReturn:
    """Print the docstring of the program, whose arguments are wrong, and notes; end it with status 2."""
    print(sys.modules["__main__"].__doc__, *notes, sep="\n", file=sys.stderr)
    sys.exit(2)


if sys.argv[1:2] in (["-h"], ["--help"]):
    print(sys.modules["__main__"].__doc__)
    sys.exit()
