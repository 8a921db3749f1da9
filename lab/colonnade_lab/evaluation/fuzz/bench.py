"""What a campaign runs: the cases of some kinds, on the hardware of one design."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

#: Outcomes of a case. The last one is a failure.
OUTCOMES = ("same", "changed", "flagged", "watchdog", "disagree")


@dataclass(frozen=True)
class Planned:
    """A case of a seed, and the legal work after it.

    Attributes:
        seed: Its seed, by which alone it is made again.
        kind: Its kind.
        change: Description of what is not as in legal work.
    """

    seed: int
    kind: str
    change: str


@dataclass(frozen=True)
class Result:
    """What a case has shown.

    Attributes:
        outcome: One of `OUTCOMES`.
        differences: Differences between hardware and model, in the case and in the legal work after it.
        is_legal_right: The legal work after it was the model's.
    """

    outcome: str
    differences: tuple[str, ...] = ()
    is_legal_right: bool = True

    @staticmethod
    def of(outcome: str, case: Sequence[str], legal: Sequence[str]) -> Result:
        """The outcome of the differences in a case, and in the legal work after it; `outcome` if there are none."""
        found = (*case, *(f"the next one: {difference}" for difference in legal))
        return Result("disagree" if found else outcome, found, not legal)


P = TypeVar("P", bound=Planned)


class Bench(ABC, Generic[P]):
    """Plans and runs the cases of a design.

    Attributes:
        kinds: Names of the kinds that the design has.
    """

    kinds: Sequence[str]

    @abstractmethod
    def plan(self, seed: int, kind: str) -> P:
        """The case of a seed and a kind, always the same."""

    @abstractmethod
    def run(self, planned: Sequence[P]) -> list[Result]:
        """Run cases, in order, on hardware and model. A case at which the hardware hangs or stops ends no later one."""

    @abstractmethod
    def sums(self) -> dict[str, int]:
        """What all runs have done, by what a line of the report says of it."""
