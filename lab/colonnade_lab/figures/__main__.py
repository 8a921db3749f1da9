"""``tools/figures``: see its usage."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

from colonnade.common.errors import UserError
from colonnade.common.processes import tool
from colonnade.design.toolchain import project_root

from colonnade_lab.figures import pages, pictures
from colonnade_lab.figures.catalog import catalog, selected
from colonnade_lab.figures.data import commands_of, digest_table, problems, release_problems
from colonnade_lab.figures.digests import emit
from colonnade_lab.figures.measure import cpu_seconds, measure, require_libraries


def main() -> None:
    """Measure, then write the pages; or only one of it."""
    docs = Path(os.environ.get("DOCS") or project_root() / "docs").resolve()
    arguments = sys.argv[1:]
    again = "--again" in arguments
    parts = tuple(argument for argument in arguments if argument != "--again")
    if parts == ("list",):
        for entry in catalog().values():
            print(f"{entry.name} ({entry.occasion}): {'; '.join(commands_of(entry))}")
    elif parts == ("digests",):
        emit(catalog().values())
        for line in digest_table(docs):
            print(line)
    elif parts[:1] == ("check",) and parts[1:] in ((), ("--quick",), ("--release",)):
        if parts[1:] != ("--quick",):
            emit(catalog().values())
        found = [*problems(docs), *pages.problems(docs), *pictures.problems(docs)]
        if parts[1:] == ("--release",):
            found += release_problems(docs)
        for problem in found:
            print(f"figures: {problem}", file=sys.stderr)
        raise SystemExit(1 if found else 0)
    else:
        if parts != ("pages",):
            _measure(parts, docs, again)
        pages.write(docs)
        pictures.write(docs)


def _measure(parts: tuple[str, ...], docs: Path, again: bool) -> None:
    try:
        entries = selected(parts)
    except KeyError as part:
        raise UserError(f"there is no part {part.args[0]}: tools/figures list names all") from None
    require_libraries(entries)
    begin = time.monotonic()
    for entry in entries:
        measure(entry, docs, again=again)
    if parts:
        for name, table in pages.tables_of(docs, [entry.name for entry in entries]):
            print(f"\n{name}\n{table}")
    minutes = (time.monotonic() - begin) / 60
    print(f"figures: {len(entries)} parts in {minutes:,.1f} minutes, {cpu_seconds() / 60:,.1f} CPU minutes", flush=True)


if __name__ == "__main__":
    tool(main)
