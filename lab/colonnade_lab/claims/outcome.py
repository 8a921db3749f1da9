"""What became of a claim: its figures, or why there are none; as text."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Figure:
    """A figure as text: what it is, on the page and now. A page without it is empty: the figure is of this machine."""

    what: str
    page: str
    now: str

    @property
    def is_equal(self) -> bool:
        """Whether it is the page's, or this machine's."""
        return self.page in ("", self.now)


@dataclass(frozen=True)
class Outcome:
    """A claim and its figures.

    Attributes:
        claim: Where the paper has it, and what it says.
        paper: The paper's figure.
        figures: Our figures.
        reason: Why there are none; None if there are.
        failed: The reason is a failure.
        seconds: Wall time.
        command: What measures it.
    """

    claim: str
    paper: str
    figures: tuple[Figure, ...] = ()
    reason: str | None = None
    failed: bool = False
    seconds: float = 0.0
    command: str = ""

    @property
    def is_right(self) -> bool:
        """Whether nothing failed, and every figure equals the page's."""
        return not self.failed and all(figure.is_equal for figure in self.figures)

    def lines(self) -> list[str]:
        """``claim | paper | page | now | equal``, a line for each figure."""
        if self.reason is not None:
            return [f"{self.claim} | {self.paper} | {self.reason} | {'failed' if self.failed else 'left out'}"]
        return [
            f"{self.claim} | {self.paper} | {each.what}: {each.page or '–'} | {each.now} | "
            f"{('yes' if each.is_equal else 'NO') if each.page else '–'}"
            for each in self.figures
        ]
