"""Standard cells: area (µm²), pins (pF), and delays (ns) as tables over slew and load."""

from __future__ import annotations

import re
from bisect import bisect_right
from dataclasses import dataclass, field
from pathlib import Path

from colonnade.common.errors import UserError


@dataclass(frozen=True)
class LookupTable:
    """A table of values over input slew (ns) and output load (pF). Each axis may have a single point."""

    slews: tuple[float, ...]
    loads: tuple[float, ...]
    values: tuple[tuple[float, ...], ...]

    def at(self, slew: float, load: float) -> float:
        """The value by bilinear interpolation, extrapolated beyond the points."""
        slews, loads, values = self.slews, self.loads, self.values
        if len(slews) == 1:
            return _interpolate(loads, values[0], load) if len(loads) > 1 else values[0][0]
        row = min(max(bisect_right(slews, slew), 1), len(slews) - 1)
        share = (slew - slews[row - 1]) / (slews[row] - slews[row - 1])
        if len(loads) == 1:
            low, high = values[row - 1][0], values[row][0]
        else:
            low, high = _interpolate(loads, values[row - 1], load), _interpolate(loads, values[row], load)
        return low + share * (high - low)


def _interpolate(points: tuple[float, ...], values: tuple[float, ...], at: float) -> float:
    index = min(max(bisect_right(points, at), 1), len(points) - 1)
    low = points[index - 1]
    return values[index - 1] + (at - low) / (points[index] - low) * (values[index] - values[index - 1])


@dataclass(frozen=True)
class Arc:
    """A timing arc from the pin `related` to the pin that holds the arc.

    Attributes:
        related: Name of the pin at the start of the arc.
        kind: ``timing_type``: ``combinational``, ``rising_edge``, ``setup_rising``, …
        sense: ``positive_unate``, ``negative_unate`` or ``non_unate``.
        tables: Tables by name: ``cell_rise``, ``rise_transition``, ``rise_constraint``, and the same for falls.
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
class FlipFlop:
    """The state of a flip-flop.

    Attributes:
        name: Name of the state in the functions of the outputs.
        inverse: Name of the inverted state in the functions of the outputs.
        clock: Clock pin.
        next_state: Function of the next state.
    """

    name: str
    inverse: str
    clock: str
    next_state: str


@dataclass(frozen=True)
class ClockGate:
    """The pins of an integrated clock gate."""

    clock: str
    enable: str
    gated: str


@dataclass(frozen=True)
class Cell:
    """A standard cell.

    Attributes:
        name: Name.
        area: Area, µm².
        is_register: Flip-flop, latch or clock gate.
        pins: Pins by name.
        flip_flop: The state of a flip-flop without set and reset.
        clock_gate: The pins of a clock gate.
    """

    name: str
    area: float
    is_register: bool
    pins: dict[str, Pin]
    flip_flop: FlipFlop | None = None
    clock_gate: ClockGate | None = None

    def is_gate(self, function: str) -> bool:
        """Whether the cell's only output computes `function`, a key of `_SPELLINGS`."""
        inputs = sorted(pin.name for pin in self.pins.values() if pin.direction == "input")
        outputs = [pin for pin in self.pins.values() if pin.direction == "output"]
        if self.is_register or len(outputs) != 1 or len(inputs) != (1 if function == "inverter" else 2):
            return False
        text = re.sub(r"\s", "", outputs[0].function).replace("*", "&").replace("+", "|")
        for name, letter in zip(inputs, "AB", strict=False):
            text = re.sub(rf"\b{re.escape(name)}\b", letter, text)
        text = re.sub(r"\((!?\w'?)\)", r"\1", text)
        return text in _SPELLINGS[function] or text[1:-1] in _SPELLINGS[function]


#: Spellings of a function of A and B, without spaces.
_SPELLINGS = {"inverter": ("!A", "A'"), "nand": ("!(A&B)", "(A&B)'", "!A|!B", "!B|!A", "A'|B'", "!(B&A)")}


@dataclass(frozen=True)
class Library:
    """The cells of all given liberty files, and the file of each cell."""

    files: tuple[Path, ...]
    cells: dict[str, Cell] = field(repr=False)
    origins: dict[str, Path] = field(repr=False, default_factory=dict)

    @property
    def nand2(self) -> Cell:
        """The smallest two-input NAND, which defines one gate equivalent."""
        return min(self._gates("nand"), key=lambda cell: (cell.area, cell.name))

    @property
    def inverter(self) -> Cell:
        """The smallest inverter; among equals the fastest."""
        return min(self._gates("inverter"), key=lambda cell: (cell.area, fan_out_of_four(cell)))

    @property
    def has_clock_gates(self) -> bool:
        """Whether flip-flops with an enable can share a gated clock instead of using multiplexers."""
        return any(cell.clock_gate for cell in self.cells.values())

    @property
    def fo4(self) -> float:
        """The fan-out-of-four delay of `inverter`, ns."""
        return fan_out_of_four(self.inverter)

    def _gates(self, function: str) -> list[Cell]:
        found = [cell for cell in self.cells.values() if cell.is_gate(function)]
        if not found:
            raise UserError(f"the liberty {', '.join(path.name for path in self.files)} has no {function}")
        return found


def fan_out_of_four(inverter: Cell) -> float:
    """Delay of an inverter that drives four copies of itself in a long chain, ns; the mean of both edges."""
    load = 4 * next(pin.capacitance for pin in inverter.pins.values() if pin.direction == "input")
    output = next(pin for pin in inverter.pins.values() if pin.direction == "output")
    tables = output.arcs[0].tables
    rise = fall = 0.0
    for _ in range(50):
        rise, fall = tables["rise_transition"].at(fall, load), tables["fall_transition"].at(rise, load)
    return (tables["cell_rise"].at(fall, load) + tables["cell_fall"].at(rise, load)) / 2
