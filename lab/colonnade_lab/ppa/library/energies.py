"""Leakage power (mW) and transition energy (pJ) of cells, from liberty files.

Only energies of the supply rails count, since some libraries list the same charge again at the ground rail.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from colonnade.common.errors import UserError

from colonnade_lab.ppa.library import liberty, liberty_files, liberty_syntax
from colonnade_lab.ppa.library.cells import LookupTable

_WATTS = {"pw": 1e-9, "nw": 1e-6, "uw": 1e-3, "mw": 1.0}
_EDGES = ("rise_power", "fall_power")


@dataclass(frozen=True)
class CellEnergy:
    """Power data of a cell.

    Attributes:
        leakage: Mean leakage over the cell's states, mW.
        pins: For each pin, the tables of its internal energy per rise and per fall, over slew and load.
    """

    leakage: float
    pins: dict[str, tuple[tuple[LookupTable, ...], tuple[LookupTable, ...]]]

    def of_transition(self, pin: str, slew: float, load: float) -> float:
        """Mean internal energy per transition of a pin, over edges, causing pins and states, pJ."""
        edges = self.pins.get(pin, ((), ()))
        means = [sum(table.at(slew, load) for table in tables) / len(tables) for tables in edges if tables]
        return sum(means) / len(_EDGES)


@dataclass(frozen=True)
class Energies:
    """The energies of a library's cells, and its voltage in V."""

    voltage: float
    cells: dict[str, CellEnergy]


def load(paths: Sequence[Path], wanted: Iterable[str]) -> Energies:
    """Read the cells `wanted` from the original files of a library, which are not pruned.

    Raises:
        UserError: The files have no common voltage.
    """
    names, cells, voltages = set(wanted), dict[str, CellEnergy](), set[float]()
    for path in paths:
        text = liberty_files.pruned(path, liberty_files.FOR_POWER)
        with liberty_syntax.parsing(path):
            library = next(liberty_syntax.groups(liberty_syntax.tokens(text)))
            voltage = float(library.text("nom_voltage", "0"))
            voltages.add(voltage * liberty.unit(library, "voltage_unit", "1V", {"v": 1.0}))
            reader = liberty.Reader(library)
            for group in library.of("cell"):
                name = group.arguments[0].strip('"')
                if name in names:
                    cells[name] = _cell(group, library, reader)
    if len(voltages) != 1 or 0.0 in voltages:
        raise UserError(f"the liberty files differ in nom_voltage ({', '.join(map(str, sorted(voltages)))} V)")
    return Energies(voltages.pop(), cells)


def _cell(group: liberty_syntax.Group, library: liberty_syntax.Group, reader: liberty.Reader) -> CellEnergy:
    grounds = {pin.arguments[0] for pin in group.of("pg_pin") if "ground" in pin.text("pg_type")}
    milliwatts = liberty.unit(library, "leakage_power_unit", "1nW", _WATTS)
    # The energy unit is capacitance times voltage squared
    picojoules = reader.load
    pins = {}
    for pin in group.of("pin"):
        tables: dict[str, list[LookupTable]] = {edge: [] for edge in _EDGES}
        for part in _at_supply(pin.of("internal_power"), grounds):
            for table in part.of(*_EDGES):
                if table.values.get("values"):
                    tables[table.name].append(reader.table(table, picojoules))
        pins[pin.arguments[0].strip('"')] = (tuple(tables["rise_power"]), tuple(tables["fall_power"]))
    return CellEnergy(milliwatts * _leakage(group, grounds), pins)


def _leakage(group: liberty_syntax.Group, grounds: set[str]) -> float:
    """The unconditional value, or the mean over the conditions."""
    found = list(_at_supply(group.of("leakage_power"), grounds))
    unconditional = [float(each.text("value")) for each in found if "when" not in each.values]
    values = unconditional or [float(each.text("value")) for each in found]
    return sum(values) / len(values) if values else float(group.text("cell_leakage_power", "0"))


def _at_supply(groups: Iterable[liberty_syntax.Group], grounds: set[str]) -> Iterable[liberty_syntax.Group]:
    return (group for group in groups if group.values.get("related_pg_pin", [""])[0] not in grounds)
