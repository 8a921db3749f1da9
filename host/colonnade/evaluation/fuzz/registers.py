"""Corruption of frame registers, except those of a room, which `environments` corrupts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from colonnade.design.manifest import Manifest, Register, value_range
from colonnade.evaluation.fuzz.cases import Case
from colonnade.evaluation.fuzz.values import random_value

#: Largest width and height of a corrupt frame, which limits the run time.
MAX_PIXELS = 40


def corrupt_registers(random: np.random.Generator, case: Case, manifest: Manifest) -> tuple[Case, str]:
    """Set one to three registers of random groups to any value that fits."""
    groups: dict[str, list[Register]] = {}
    for register in manifest.registers.values():
        if (
            register.access == "rw"
            and register.name != "frame.watchdogCycles"
            and not register.name.startswith("environment.")
        ):
            groups.setdefault(register.name.split("[")[0].rsplit(".", 1)[0], []).append(register)
    values = dict(case.registers)
    changes = []
    for _ in range(int(random.integers(1, 4))):
        members = list(groups.values())[int(random.integers(len(groups)))]
        register = members[int(random.integers(len(members)))]
        values[register.name] = _value(random, register, values[register.name])
        changes.append(f"{register.name} = {values[register.name]}")
    return replace(case, registers=values), "; ".join(changes)


def _value(random: np.random.Generator, register: Register, current: int) -> int:
    minimum, maximum = value_range(register.width, register.signed)
    if register.name in ("frame.width", "frame.height"):
        return int(random.integers(MAX_PIXELS + 1))
    if random.random() < 0.25:
        flipped = (current ^ (1 << int(random.integers(register.width)))) & ((1 << register.width) - 1)
        return flipped - (1 << register.width) if register.signed and flipped >> (register.width - 1) else flipped
    return random_value(random, minimum, maximum)
