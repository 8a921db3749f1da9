"""Reads standard cells from pruned liberty files."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from colonnade.common.errors import UserError

from colonnade_lab.ppa.library.cells import Arc, Cell, ClockGate, FlipFlop, Library, LookupTable, Pin
from colonnade_lab.ppa.library.liberty_syntax import Group, groups, parsing, tokens


def load(paths: Sequence[Path]) -> Library:
    """Read the library of some pruned files."""
    cells: dict[str, Cell] = {}
    origins: dict[str, Path] = {}
    for path in paths:
        with parsing(path):
            top = next(groups(tokens(path.read_text("latin-1"))))
            own = dict(Reader(top).cells())
        cells |= own
        origins |= dict.fromkeys(own, path)
    return Library(tuple(paths), cells, origins)


class Reader:
    """Turns the groups of one library into cells. `time` and `load` are its units in ns and pF."""

    def __init__(self, library: Group) -> None:
        self._library = library
        self.time = unit(library, "time_unit", "1ns", {"ps": 1e-3, "ns": 1.0})
        amount, farads = (*library.values.get("capacitive_load_unit", []), "1", "pf")[:2]
        self.load = _finite(amount) * {"ff": 1e-3, "pf": 1.0}[farads.strip('"').lower()]
        kinds = ("lu_table_template", "power_lut_template")
        self._templates = {template.arguments[0]: template for template in library.of(*kinds)}

    def cells(self) -> Iterator[tuple[str, Cell]]:
        """All usable cells by name."""
        for group in self._library.of("cell"):
            name = group.arguments[0].strip('"')
            if group.text("dont_use") == "true":
                continue
            pins = {pin.name: pin for part in group.of("pin") for pin in [self._pin(part)]}
            is_register = any(True for _ in group.of("ff", "latch", "statetable"))
            area = _finite(group.text("area", "0"))
            yield name, Cell(name, area, is_register, pins, _flip_flop(group), _clock_gate(group))

    def _pin(self, group: Group) -> Pin:
        arcs = tuple(self._arc(timing) for timing in group.of("timing"))
        capacitance = _finite(group.text("capacitance", "0")) * self.load
        return Pin(group.arguments[0].strip('"'), group.text("direction"), capacitance, group.text("function"), arcs)

    def _arc(self, group: Group) -> Arc:
        tables = {table.name: self.table(table, self.time) for table in group.groups if table.values.get("values")}
        sense = group.text("timing_sense", "non_unate")
        return Arc(group.text("related_pin"), group.text("timing_type", "combinational"), sense, tables)

    def table(self, group: Group, scale: float) -> LookupTable:
        """A table with its values times `scale`.

        The axis `slews` has the slew or the constrained pin's slew, `loads` the load or the clock's slew.
        """
        template = self._templates.get(group.arguments[0]) if group.arguments else None
        axes: dict[str, tuple[float, ...]] = {}
        for number in ("1", "2"):
            variable = template.text(f"variable_{number}") if template else ""
            words = group.values.get(f"index_{number}") or (template and template.values.get(f"index_{number}"))
            if variable and words:
                unit_of_axis = self.load if "capacitance" in variable else self.time
                name = "loads" if "capacitance" in variable or "related" in variable else "slews"
                axes[name] = tuple(unit_of_axis * value for value in _numbers(words))
        slews, loads = axes.get("slews", (0.0,)), axes.get("loads", (0.0,))
        flat = [scale * value for value in _numbers(group.values["values"])]
        if len(flat) != len(slews) * len(loads):
            raise ValueError(f"a table of {len(slews)} by {len(loads)} points has {len(flat)} values")
        if next(iter(axes), "slews") == "slews":
            values = tuple(tuple(flat[i * len(loads) : (i + 1) * len(loads)]) for i in range(len(slews)))
        else:
            values = tuple(tuple(flat[i :: len(slews)]) for i in range(len(slews)))
        return LookupTable(slews, loads, values)


def _flip_flop(cell: Group) -> FlipFlop | None:
    """The state of a flip-flop without set and reset; None for all other cells."""
    for group in cell.of("ff"):
        if "clear" not in group.values and "preset" not in group.values:
            names = [word.strip('"') for word in group.arguments]
            return FlipFlop(names[0], names[1], group.text("clocked_on"), group.text("next_state"))
    return None


def _clock_gate(cell: Group) -> ClockGate | None:
    """The pins of a latch-based clock gate for rising edges; None for all other cells."""
    if not cell.text("clock_gating_integrated_cell").startswith("latch_posedge"):
        return None
    roles = ("clock", "enable", "out")
    found = [pin.arguments[0].strip('"') for role in roles for pin in cell.of("pin") if _is_gate_pin(pin, role)]
    return ClockGate(*found) if len(found) == len(roles) else None


def _is_gate_pin(pin: Group, role: str) -> bool:
    return pin.text(f"clock_gate_{role}_pin") == "true"


def _numbers(words: Sequence[str]) -> list[float]:
    return [_finite(number) for word in words for number in re.split(r"[\s,\\]+", word.strip('"').strip()) if number]


def _finite(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(f"{text} is not a finite number")
    return number


def unit(library: Group, name: str, default: str, units: dict[str, float]) -> float:
    """The factor from a unit of the library to ours. `units` has the known units in lower case."""
    text = library.text(name, default)
    match = re.fullmatch(r"([\d.]+)\s*(\w+)", text)
    if match is None or match[2].lower() not in units:
        raise UserError(f"the liberty's {name} is {text}: only {' and '.join(units)} are supported")
    return float(match[1]) * units[match[2].lower()]
