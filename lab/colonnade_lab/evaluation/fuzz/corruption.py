"""The kinds of corruption of a legal frame, one function each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from colonnade.design.manifest import Manifest
from colonnade.scene.prepared.gathered_light import MEMORY as LIGHT_CUBE
from colonnade.scene_image.file import LoadSection

from colonnade_lab.evaluation.fuzz.cases import Case
from colonnade_lab.evaluation.fuzz.environments import corrupt_maps
from colonnade_lab.evaluation.fuzz.gathered import corrupt_gathered
from colonnade_lab.evaluation.fuzz.instances import corrupt_instances
from colonnade_lab.evaluation.fuzz.records import corrupt_records
from colonnade_lab.evaluation.fuzz.registers import corrupt_registers

#: Returns the corrupt case and a short description of the change.
Corrupt = Callable[[np.random.Generator, Case, Manifest], tuple[Case, str]]


@dataclass(frozen=True)
class Kind:
    """A kind of corruption.

    Attributes:
        name: Name for ``--kind``.
        corrupt: Corrupts a case; its random generator determines the result.
        applies: Whether a legal case has data of this kind.
    """

    name: str
    corrupt: Corrupt
    applies: Callable[[Case], bool] = lambda case: True


def corrupt_both(random: np.random.Generator, case: Case, manifest: Manifest) -> tuple[Case, str]:
    """Corrupt records and registers."""
    case, records = corrupt_records(random, case, manifest)
    case, registers = corrupt_registers(random, case, manifest)
    return case, f"{records}; {registers}"


def _is_map(section: LoadSection) -> bool:
    return section.memory != LIGHT_CUBE


KINDS = {
    kind.name: kind
    for kind in (
        Kind("records", corrupt_records),
        Kind("registers", corrupt_registers),
        Kind("both", corrupt_both),
        Kind("maps", corrupt_maps, lambda case: any(map(_is_map, case.image.attributes))),
        Kind("gather", corrupt_gathered, lambda case: case.gathers),
        Kind("instances", corrupt_instances, lambda case: case.has_instances),
    )
}

#: Share of the frames of a design that gathers light whose legal frame does.
GATHERED_SHARE = 0.5


def corrupt_case(seed: int, kind: Kind, cases: tuple[Case, ...], manifest: Manifest) -> tuple[Case, Case, str]:
    """The legal case and the corrupt case of a seed, and a description of the change."""
    random = np.random.default_rng(seed)
    applicable = [case for case in cases if kind.applies(case)]
    if any(case.gathers for case in applicable):
        gathers = random.random() < GATHERED_SHARE
        applicable = [case for case in applicable if case.gathers == gathers] or applicable
    legal = applicable[int(random.integers(len(applicable)))]
    corrupt, change = kind.corrupt(random, legal, manifest)
    return legal, corrupt, f"{legal.name}: {change}"
