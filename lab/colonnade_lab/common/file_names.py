"""Distinct file names made from names that a user gives."""

from __future__ import annotations

import re

#: Characters of a file name, without its number and suffix.
MAX_NAME = 100


class FileNames:
    """Makes a file name of each name. No two are equal, also where upper and lower case are the same."""

    def __init__(self) -> None:
        self._taken: set[str] = set()

    def of(self, name: str) -> str:
        """The file name for a name: its plain characters, with a number if they are taken."""
        stem = re.sub(r"[^A-Za-z0-9=._-]+", "-", name).lstrip(".-")[:MAX_NAME] or "unnamed"
        found, number = stem, 1
        while found.casefold() in self._taken:
            number += 1
            found = f"{stem}.{number}"
        self._taken.add(found.casefold())
        return found
