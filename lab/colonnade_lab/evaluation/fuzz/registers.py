"""Corruption of the registers of a frame."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from colonnade.design.manifest import Manifest, Register, value_range
from colonnade.scene.prepared.gathered_light import MEMORY as LIGHT_CUBE
from colonnade.scene_image.dram_image import PAGE_BYTES

from colonnade_lab.evaluation.fuzz.cases import Case
from colonnade_lab.evaluation.fuzz.values import random_value

#: Largest width and height of a corrupt frame, which limits the run time.
MAX_PIXELS = 24

#: The time of the watchdog, which the model does not know.
EXCLUDED = ("frame.watchdogCycles",)

#: Lower and upper ends of intervals: the names of their registers, without the axis, and the axes.
INTERVALS = (
    ("bounds.low.{}", "bounds.high.{}", "xyz"),
    ("frame.objectRect.{}0", "frame.objectRect.{}1", "xy"),
    ("environment.window.{}0", "environment.window.{}1", "xy"),
)

#: The registers that a corruption may change, by name.
Registers = Mapping[str, Register]

#: Returns new values of some registers.
Mutation = Callable[[np.random.Generator, Registers, Case], dict[str, int]]


def corrupt_registers(random: np.random.Generator, case: Case, manifest: Manifest) -> tuple[Case, str]:
    """Set fields, vectors, intervals or all registers to corner cases, or to values near the legal ones."""
    registers = reachable(case, manifest)
    draw = random.random()
    mutation = next(mutation for limit, mutation in _MUTATIONS if draw < limit)
    changed = mutation(random, registers, case)
    for name in changed.keys() & {"frame.width", "frame.height"}:
        changed[name] = int(random.integers(MAX_PIXELS + 1))
    if "dram.page" in changed and random.random() < 0.5:
        changed["dram.page"] = int(random.integers(2 + case.image.records.nbytes // PAGE_BYTES))
    change = "; ".join(f"{name} = {value}" for name, value in changed.items())
    if mutation is _all:
        change = "all registers"
    return replace(case, registers={**case.registers, **changed}), change


def reachable(case: Case, manifest: Manifest) -> Registers:
    """The registers that may change: all writable ones but `EXCLUDED` and ones that would show a memory whose words
    the case does not load, which hold an earlier frame's.
    """
    memories = {section.memory for section in case.image.attributes}
    shows = {"environment.enabled": case.image.header.room is not None, "gather.bounces": LIGHT_CUBE in memories}
    textured = any(memory.startswith("texture.") for memory in memories)
    return {
        name: register
        for name, register in manifest.registers.items()
        if register.access == "rw"
        and name not in EXCLUDED
        and shows.get(name, textured or not name.endswith(".hasTexture"))
    }


def _groups(registers: Registers) -> list[list[Register]]:
    """The registers by what they describe: a vector, a table, or a section of the register map."""
    groups: dict[str, list[Register]] = {}
    for register in registers.values():
        groups.setdefault(register.name.split("[")[0].rsplit(".", 1)[0], []).append(register)
    return list(groups.values())


def _some(random: np.random.Generator, registers: Registers) -> Sequence[Register]:
    """One to three registers of random groups."""
    groups = _groups(registers)
    chosen = [groups[int(random.integers(len(groups)))] for _ in range(int(random.integers(1, 4)))]
    return [group[int(random.integers(len(group)))] for group in chosen]


def _fields(random: np.random.Generator, registers: Registers, case: Case) -> dict[str, int]:
    """One to three registers have any value that fits."""
    return {register.name: _any(random, register) for register in _some(random, registers)}


def _near(random: np.random.Generator, registers: Registers, case: Case) -> dict[str, int]:
    """One to three registers differ from the legal value by one bit, or by little."""
    changed = {}
    for register in _some(random, registers):
        current = case.registers[register.name]
        if random.random() < 0.5:
            changed[register.name] = _fitted(register, current ^ (1 << int(random.integers(register.width))))
        else:
            lowest, highest = value_range(register.width, register.signed)
            changed[register.name] = min(max(current + int(random.integers(-4, 5)), lowest), highest)
    return changed


def _inverted(random: np.random.Generator, registers: Registers, case: Case) -> dict[str, int]:
    """The ends of an interval are swapped, or the lower one is above the upper one by little or by any amount."""
    intervals = [(low, high, axes) for low, high, axes in INTERVALS if low.format(axes[0]) in registers]
    low, high, axes = intervals[int(random.integers(len(intervals)))]
    axis = axes[int(random.integers(len(axes)))]
    many = random.random() < 0.3
    changed: dict[str, int] = {}
    for each in axes if many else axis:
        names = low.format(each), high.format(each)
        highest = value_range(registers[names[0]].width, registers[names[0]].signed)[1]
        ends = sorted(case.registers[name] for name in names)
        how = int(random.integers(4))
        if how == 1:
            ends = sorted(_any(random, registers[name]) for name in names)
        elif how == 2:
            ends = [ends[1], min(ends[1] + int(random.integers(1, 1 << int(random.integers(1, 12)))), highest)]
        elif how == 3:
            ends = [0, highest]
        changed |= {names[0]: ends[1], names[1]: ends[0]}
    return changed


def _vector(random: np.random.Generator, registers: Registers, case: Case) -> dict[str, int]:
    """All registers of a group have any value, are zero, all ones, the least or the greatest one."""
    groups = _groups(registers)
    group = groups[int(random.integers(len(groups)))]
    how = int(random.integers(5))
    return {register.name: _extreme(random, register, how) for register in group}


def _all(random: np.random.Generator, registers: Registers, case: Case) -> dict[str, int]:
    """All registers have any value, except the scene's sections, which would leave little to trace."""
    return {
        name: _any(random, register) if random.random() < 0.7 else case.registers[name]
        for name, register in registers.items()
        if not name.startswith(("scene.", "dram."))
    }


#: Mutations, with the sum of their shares.
_MUTATIONS: tuple[tuple[float, Mutation], ...] = (
    (0.35, _fields),
    (0.6, _near),
    (0.78, _inverted),
    (0.97, _vector),
    (1.0, _all),
)


def _any(random: np.random.Generator, register: Register) -> int:
    return random_value(random, *value_range(register.width, register.signed))


def _extreme(random: np.random.Generator, register: Register, how: int) -> int:
    lowest, highest = value_range(register.width, register.signed)
    return (_any(random, register), 0, _fitted(register, -1), lowest, highest)[how]


def _fitted(register: Register, value: int) -> int:
    """The value of the register's low bits."""
    low = value & ((1 << register.width) - 1)
    return low - (1 << register.width) if register.signed and low >> (register.width - 1) else low
