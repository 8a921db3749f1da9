"""Gathered light: legal frames with any light cube, and corruption of its registers and its cube."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from colonnade.design.manifest import Manifest, Register, value_range
from colonnade.scene.prepared.gathered_light import LAST_PARALLAX
from colonnade.scene.prepared.gathered_light import MEMORY as LIGHT_CUBE
from colonnade.scene_image.file import LoadSection

from colonnade_lab.evaluation.fuzz.cases import Case
from colonnade_lab.evaluation.fuzz.environments import corrupt_words
from colonnade_lab.evaluation.fuzz.registers import reachable
from colonnade_lab.evaluation.fuzz.values import random_value


def with_any_light(cases: Sequence[Case], manifest: Manifest) -> tuple[Case, ...]:
    """The cases, and for each that gathers light some others: with a cube of random words, and at any sample points.

    One for each distance of the cube's surfaces, with another number of gathered rays and any lobes.
    """
    random, added = np.random.default_rng(1), list[Case]()
    for case in cases:
        for number in range(1, LAST_PARALLAX + 1) if case.gathers else ():
            drawn = {
                register.name: int(random.integers(1 << register.width))
                for register in _registers(case, manifest)
                if register.name.startswith("gather.points") or ".lobe." in register.name
            }
            drawn |= {"gather.parallax": number, "gather.bounces": number}
            sections = (_drawn(random, section) for section in case.image.attributes)
            image = replace(case.image, attributes=tuple(sections))
            added.append(Case(f"{case.name}, any cube {number}", image, {**case.registers, **drawn}))
    return *cases, *added


def corrupt_gathered(random: np.random.Generator, case: Case, manifest: Manifest) -> tuple[Case, str]:
    """Set registers of gathered light and of the surfaces in use to any value, and overwrite words of the cube."""
    candidates = _registers(case, manifest)
    count = len(candidates) if random.random() < 0.3 else int(random.integers(1, 6))
    values = dict(case.registers)
    for index in random.permutation(len(candidates))[:count]:
        register = candidates[index]
        values[register.name] = random_value(random, *value_range(register.width, register.signed))
    if random.random() < 0.7:
        values["gather.bounces"] = int(random.integers(1, 8))
    changes = [f"{name} = {value}" for name, value in values.items() if value != case.registers[name]]
    if random.random() < 0.4:
        case, change = corrupt_words(random, case, manifest, LIGHT_CUBE)
        changes.append(change)
    return replace(case, registers=values), "; ".join(changes)


def _registers(case: Case, manifest: Manifest) -> list[Register]:
    """The registers of gathered light, and of the kinds and lobes of the case's materials."""
    materials = tuple(f"materials[{index}]." for index in range(len(case.image.header.materials)))
    return [
        register
        for name, register in reachable(case, manifest).items()
        if name.startswith("gather.") or (name.startswith(materials) and (".lobe." in name or name.endswith(".kind")))
    ]


def _drawn(random: np.random.Generator, section: LoadSection) -> LoadSection:
    """The section with random words if it is the cube's."""
    if section.memory != LIGHT_CUBE:
        return section
    return replace(section, words=random.integers(0, 256, section.words.shape, dtype=np.uint8))
