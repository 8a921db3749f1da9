"""Generates the tables of the pages that show a study of `tools/studies`.

A table replaces the text between ``<!-- NAME -->`` and ``<!-- end -->``; the rest of the page stays as it is.
Run as ``python -m colonnade.lab.explore.pages DOCS``: data are ``DOCS/data/STUDY.json``, pages ``DOCS/STUDY.md``.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from colonnade.common.atomic_files import replacing
from colonnade.lab.explore import precision_tables, search_tables

Data = Mapping[str, Any]

#: The tables of each study's page.
PAGES: Mapping[str, Mapping[str, Callable[[Data], str]]] = {
    "mixed-precision": precision_tables.TABLES,
    "energy-area": search_tables.TABLES,
}

_TABLE = re.compile(r"(<!-- (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)


def page(text: str, name: str, study: Data | None) -> str:
    """The page of the study `name` with new tables from its ``study.json``; None: not measured."""

    def replaced(match: re.Match[str]) -> str:
        body = f"Not measured: run `tools/studies {name}`." if study is None else PAGES[name][match[2]](study)
        return f"{match[1]}{body}\n{match[3]}"

    return _TABLE.sub(replaced, text)


def main(docs: Path) -> None:
    """Rewrite the pages in the folder `docs`."""
    for name in PAGES:
        data, file = docs / "data" / f"{name}.json", docs / f"{name}.md"
        text = page(file.read_text(), name, json.loads(data.read_text()) if data.is_file() else None)
        with replacing(file) as stream:
            stream.write(text.encode())


if __name__ == "__main__":
    main(Path(sys.argv[1]))
