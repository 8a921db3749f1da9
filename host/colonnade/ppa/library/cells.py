"""Standard cells: area, pins, and delays as tables of slew and load; in µm², pF and ns."""

from __future__ import annotations

import re
from bisect import bisect_right
from dataclasses import dataclass, field
from pathlib import Path

from colonnade.common.errors import UserError


@dataclass(frozen=True)
class LookupTable:
    """A value, in ns, over input slew (ns) and output load (pF); a table of one row or column, or a scalar too."""

    slews: tuple[float, ...]
    loads: tuple[float, ...]
    values: tuple[tuple[float, ...], ...]

    def at(self, slew: float, load: float) -> float:
        """Bilinear between the points, and straight on beyond them."""
        slews, loads, values = self.slews, self.loads, self.values
        if len(slews) == 1:
            return _along(loads, values[0], load) if len(loads) > 1 else values[0][0]
        row = min(max(bisect_right(slews, slew), 1), len(slews) - 1)
        share = (slew - slews[row - 1]) / (slews[row] - slews[row - 1])
        if len(loads) == 1:
            low, high = values[row - 1][0], values[row][0]
        else:
            low, high = _along(loads, values[row - 1], load), _along(loads, values[row], load)
        return low + share * (high - low)


def _along(points: tuple[float, ...], values: tuple[float, ...], at: float) -> float:
    index = min(max(bisect_right(points, at), 1), len(points) - 1)
    low = points[index - 1]
    return values[index - 1] + (at - low) / (points[index] - low) * (values[index] - values[index - 1])


@dataclass(frozen=True)
class Arc:
    """From the pin `related` to the pin that holds it.

    Attributes:
        kind: ``timing_type``: ``combinational``, ``rising_edge``, ``setup_rising``, …
        sense: ``positive_unate``, ``negative_unate`` or ``non_unate``.
        tables: by name: ``cell_rise``, ``rise_transition``, ``rise_constraint``, and the same of fall.
    """

    related: str
    kind: str
    sense: str
    tables: dict[str, LookupTable]


@dataclass(frozen=True)
class Pin:
    """A pin; capacitance in pF."""

    name: str
    direction: str
    capacitance: float
    function: str
    arcs: tuple[Arc, ...]


@dataclass(frozen=True)
class State:
    """What a flip-flop holds: the names of it and of its inverse in the outputs' functions; clock; what comes next."""

    name: str
    inverse: str
    clock: str
    following: str


@dataclass(frozen=True)
class ClockGate:
    """An integrated clock gate: its pins of the clock, of what enables it, and of the gated clock."""

    clock: str
    enable: str
    gated: str


@dataclass(frozen=True)
class Cell:
    """A cell; area in µm²; `state` is of flip-flops alone, `clock_gate` of clock gates, which are registers, too."""

    name: str
    area: float
    is_register: bool
    pins: dict[str, Pin]
    state: State | None = None
    clock_gate: ClockGate | None = None

    def is_gate(self, function: str) -> bool:
        """It computes `function`, a key of `_SPELLINGS`, and nothing else."""
        inputs = sorted(pin.name for pin in self.pins.values() if pin.direction == "input")
        outputs = [pin for pin in self.pins.values() if pin.direction == "output"]
        if self.is_register or len(outputs) != 1 or len(inputs) != (1 if function == "inverter" else 2):
            return False
        text = re.sub(r"\s", "", outputs[0].function).replace("*", "&").replace("+", "|")
        for name, letter in zip(inputs, "AB", strict=False):
            text = re.sub(rf"\b{re.escape(name)}\b", letter, text)
        text = re.sub(r"\((!?\w'?)\)", r"\1", text)
        return text in _SPELLINGS[function] or text[1:-1] in _SPELLINGS[function]


#: The ways to write a function of A and B, without blanks.
_SPELLINGS = {"inverter": ("!A", "A'"), "nand": ("!(A&B)", "(A&B)'", "!A|!B", "!B|!A", "A'|B'", "!(B&A)")}


@dataclass(frozen=True)
class Library:
    """The cells of all files that were named."""

    files: tuple[Path, ...]
    cells: dict[str, Cell] = field(repr=False)

    @property
    def nand2(self) -> Cell:
        """The smallest NAND of two inputs: the unit of gate equivalents."""
        return min(self._gates("nand"), key=lambda cell: (cell.area, cell.name))

    @property
    def inverter(self) -> Cell:
        """The quickest of the smallest inverters."""
        return min(self._gates("inverter"), key=lambda cell: (cell.area, fan_out_of_four(cell)))

    @property
    def has_clock_gates(self) -> bool:
        """Flip-flops with an enable may share a gated clock instead of a multiplexer each."""
        return any(cell.clock_gate for cell in self.cells.values())

    @property
    def fo4(self) -> float:
        """The delay of `inverter` that drives four of its like, in ns."""
        return fan_out_of_four(self.inverter)

    def _gates(self, function: str) -> list[Cell]:
        found = [cell for cell in self.cells.values() if cell.is_gate(function)]
        if not found:
            raise UserError(f"no {function} among the cells of {', '.join(path.name for path in self.files)}")
        return found


def fan_out_of_four(inverter: Cell) -> float:
    """Delay, in ns, of an inverter that drives four of its like in a long chain of such; the mean of both edges."""
    load = 4 * next(pin.capacitance for pin in inverter.pins.values() if pin.direction == "input")
    output = next(pin for pin in inverter.pins.values() if pin.direction == "output")
    tables = output.arcs[0].tables
    rise = fall = 0.0
    for _ in range(50):
        rise, fall = tables["rise_transition"].at(fall, load), tables["fall_transition"].at(rise, load)
    return (tables["cell_rise"].at(fall, load) + tables["cell_fall"].at(rise, load)) / 2
