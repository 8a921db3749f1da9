"""What cells take, from liberty files: leakage, and energy by transition; in mW and pJ.

Energies are those that are drawn from the supply rails; some libraries list the same charge once more at the ground.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from colonnade.common.errors import UserError
from colonnade.ppa.library import liberty
from colonnade.ppa.library.cells import LookupTable

_WATTS = {"pw": 1e-9, "nw": 1e-6, "uw": 1e-3, "mw": 1.0}
_EDGES = ("rise_power", "fall_power")


@dataclass(frozen=True)
class CellEnergy:
    """A cell.

    Attributes:
        leakage: mW, the mean over its states.
        pins: for each pin the tables, of slew and load, of the energy of one transition of that pin beside that of the
            load: those of the rise and those of the fall.
    """

    leakage: float
    pins: dict[str, tuple[tuple[LookupTable, ...], tuple[LookupTable, ...]]]

    def of_transition(self, pin: str, slew: float, load: float) -> float:
        """pJ of one transition of a pin: the mean of rise and fall, of the pins that may cause it, and of states."""
        edges = self.pins.get(pin, ((), ()))
        means = [sum(table.at(slew, load) for table in tables) / len(tables) for tables in edges if tables]
        return sum(means) / len(_EDGES)


@dataclass(frozen=True)
class Energies:
    """All cells of a library; its voltage in V."""

    voltage: float
    cells: dict[str, CellEnergy]


def load(paths: Sequence[Path], wanted: Iterable[str]) -> Energies:
    """Read the cells `wanted` from the original, not the pruned, files of a library."""
    names, cells, voltages = set(wanted), dict[str, CellEnergy](), set[float]()
    for path in paths:
        text = liberty.pruned(path, liberty.FOR_POWER)
        with liberty.understood(path):
            library = next(liberty.groups(liberty.tokens(text)))
            voltage = float(library.text("nom_voltage", "0"))
            voltages.add(voltage * liberty.unit(library, "voltage_unit", "1V", {"v": 1.0}))
            reader = liberty.Reader(library)
            for group in library.of("cell"):
                name = group.arguments[0].strip('"')
                if name in names:
                    cells[name] = _cell(group, library, reader)
    if len(voltages) != 1 or 0.0 in voltages:
        raise UserError(f"the liberties have no common nom_voltage ({', '.join(map(str, sorted(voltages)))} V)")
    return Energies(voltages.pop(), cells)


def _cell(group: liberty.Group, library: liberty.Group, reader: liberty.Reader) -> CellEnergy:
    grounds = {pin.arguments[0] for pin in group.of("pg_pin") if "ground" in pin.text("pg_type")}
    milliwatts = liberty.unit(library, "leakage_power_unit", "1nW", _WATTS)
    # Capacitance times voltage squared
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


def _leakage(group: liberty.Group, grounds: set[str]) -> float:
    """The value without a condition, or the mean over the conditions."""
    found = list(_at_supply(group.of("leakage_power"), grounds))
    plain = [float(each.text("value")) for each in found if "when" not in each.values]
    values = plain or [float(each.text("value")) for each in found]
    return sum(values) / len(values) if values else float(group.text("cell_leakage_power", "0"))


def _at_supply(groups: Iterable[liberty.Group], grounds: set[str]) -> Iterable[liberty.Group]:
    return (group for group in groups if group.values.get("related_pg_pin", [""])[0] not in grounds)
