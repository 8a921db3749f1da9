"""Ways to corrupt a legal frame. A kind of corruption is one function; `KINDS` has them all."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from colonnade.design.manifest import Manifest
from colonnade.evaluation.fuzz.cases import Case
from colonnade.evaluation.fuzz.environments import corrupt_maps
from colonnade.evaluation.fuzz.records import corrupt_records
from colonnade.evaluation.fuzz.registers import corrupt_registers

#: Gives the corrupt case and says in a few words what was changed.
Corrupt = Callable[[np.random.Generator, Case, Manifest], tuple[Case, str]]


@dataclass(frozen=True)
class Kind:
    """A kind of corruption.

    Attributes:
        name: For ``--kind``.
        corrupt: Changes a case at random; takes nothing from anywhere but its generator.
        applies: Whether a legal case has something of that kind.
    """

    name: str
    corrupt: Corrupt
    applies: Callable[[Case], bool] = lambda case: True


KINDS = {
    kind.name: kind
    for kind in (
        Kind("records", corrupt_records),
        Kind("registers", corrupt_registers),
        Kind("maps", corrupt_maps, lambda case: bool(case.image.attributes)),
    )
}


def corrupt_case(seed: int, kind: Kind, cases: tuple[Case, ...], manifest: Manifest) -> tuple[Case, Case, str]:
    """The corrupt case of a seed: the legal one it is made of, itself, and what was changed."""
    random = np.random.default_rng(seed)
    usable = [case for case in cases if kind.applies(case)]
    legal = usable[int(random.integers(len(usable)))]
    corrupt, change = kind.corrupt(random, legal, manifest)
    return legal, corrupt, f"{legal.name}: {change}"
