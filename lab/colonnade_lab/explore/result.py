"""The result of a job: a folder of files, of which ``result.json`` holds the figures."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from colonnade.common.atomic_files import write_json

#: The figures of a result.
RESULT = "result.json"

#: The content of a result: each file by its name.
Content = Mapping[str, bytes]


def write_result(folder: Path, figures: Mapping[str, Any]) -> None:
    """Write the figures of a result."""
    write_json(folder / RESULT, figures)


def figures_of(folder: Path) -> dict[str, Any]:
    """The figures of a result."""
    figures: dict[str, Any] = json.loads((folder / RESULT).read_text())
    return figures
