"""The page's data measured again, entry by entry, and its tables compared. It takes hours, and resumes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from colonnade.common.errors import UserError

from colonnade_lab.claims.outcome import Figure, Outcome
from colonnade_lab.common import paper
from colonnade_lab.figures import pages, paper_tables
from colonnade_lab.figures.catalog import catalog
from colonnade_lab.figures.data import Data, Missing
from colonnade_lab.figures.measure import measure, require_libraries

#: The tables of the page: what each shows, and the paper's figure.
TABLES: Mapping[str, tuple[str, str]] = {
    "bvh-tests": ("III-A: tests with and without a tree", "–"),
    "bvh-cycles": ("IV-A, Fig. 7(a), 9(b): time with and without a tree", f"{paper.TREE_SPEED_UP:g} times"),
    "bvh-costs": ("IV-A, Fig. 7(b): what the tree costs", "+5.6 % memory, +5.7 % area"),
    "bvh-power": ("V, Fig. 9(c): power with and without a tree", "+5 %"),
    "precision": ("IV-C, Fig. 6(a), 8(a): eight precisions", "–"),
    "render-index": ("IV-C, Fig. 8(b): RenderIndex", f"{paper.PRECISION} is lowest"),
    "savings": ("IV-C, Fig. 8(c): savings", "33.4 % power, 16.7 % area"),
    "paper-maps": ("IV-B: maps", f"{paper.MAP_RATIO} times"),
    "room-mesh": ("III-B: the room as a mesh, and its march", "O(n log n)"),
    "paper-unit": ("Fig. 4: one unit of the paper", "–"),
    "table-1": ("Table 1", f"{paper.FRAMES_PER_JOULE} frames/s/W"),
}


class _Both(Data):
    """Data measured now, else the page's."""

    def __init__(self, now: Path, page: Data) -> None:
        super().__init__(now)
        self._page = page

    def get(self, name: str) -> Mapping[str, Any] | None:
        """See `Data`."""
        found = super().get(name)
        return self._page.get(name) if found is None else found


def outcomes(data: Data, folder: Path) -> Iterator[Outcome]:
    """Measure all entries of the page that `folder` does not have yet, then compare the tables.

    Args:
        data: The data of the page.
        folder: Receives the data files; files of an earlier run of the same sources are kept.
    """
    entries = catalog()
    for name in paper_tables.PARTS:
        try:
            require_libraries([entries[name]])
            measure(entries[name], folder)
        except UserError as error:
            yield Outcome(f"tools/figures {name}", "–", reason=str(error), failed=True)
    now = _Both(folder, data)
    for table, (claim, published) in TABLES.items():
        try:
            page, again = (_rows(pages.TABLES[table](of)) for of in (data, now))
        except Missing as missing:
            yield Outcome(claim, published, reason=f"docs/data has no {missing}")
            continue
        names = dict.fromkeys([*page, *again])
        yield Outcome(
            claim, published, tuple(Figure(name, page.get(name, "none"), again.get(name, "none")) for name in names)
        )


def _rows(table: str) -> dict[str, str]:
    """The rows of a Markdown table by their first cell."""
    cells = (line.strip("|").split("|") for line in table.splitlines()[2:])
    return {first.strip("* "): ", ".join(rest) for first, *rest in cells}
