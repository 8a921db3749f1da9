"""OpenSTA, where it is on ``PATH``, as a second opinion: on the slowest path between registers, and on power.

Power takes one that reads SAIF; Debian's of 2019 does not, and ignores activities of single nets without a word.
"""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path

from colonnade.common import processes
from colonnade.common.temporary import temporary_folder
from colonnade.ppa.library.cells import Library
from colonnade.ppa.netlist.mapped import Bit, Netlist
from colonnade.ppa.power.replay import Activity

#: The clock's port in every unit.
CLOCK = "clock"


def is_available() -> bool:
    """There is an OpenSTA to ask."""
    return shutil.which("sta") is not None


def reads_activities() -> bool:
    """There is one that reads SAIF."""
    return is_available() and "read_saif" in _run(["puts [info commands read_saif]"], (), ())


def register_to_register(netlist: Netlist, library: Library, slew: float, load: float) -> float | None:
    """The slowest path from clock to set-up in ns, by OpenSTA; None where there is no such path.

    Args:
        netlist: a unit.
        library: its cells, from pruned files.
        slew: of the clock, in ns.
        load: of every output, in pF.
    """
    said = _run(
        [
            *_linked(library.files),
            "set_cmd_units -time ns -capacitance pF",
            f"create_clock -name clock -period 1000 [get_ports {CLOCK}]",
            f"set_clock_transition {slew:.6f} [get_clocks clock]",
            f"set_load {load:.6f} [all_outputs]",
            "report_checks -path_delay max -from [all_registers -clock_pins] -to [all_registers -data_pins] -digits 6",
        ],
        library.files,
        list(_verilog(netlist)),
    )
    arrival = re.search(r"([\d.]+)\s+data arrival time", said)
    setup = re.search(r"(-?[\d.]+)\s+[\d.]+\s+library setup time", said)
    return float(arrival[1]) - float(setup[1]) if arrival and setup else None


def power(
    netlist: Netlist, liberties: Sequence[Path], activity: Activity, slew: float, megahertz: float
) -> float | None:
    """All power of the gates in mW, by OpenSTA with the activity of every net; None where it tells none.

    Args:
        netlist: the gates.
        liberties: the original files, with energies.
        activity: of the nets.
        slew: of the clock, in ns.
        megahertz: the clock.
    """
    said = _run(
        [
            *_linked(liberties),
            "set_cmd_units -time ns -capacitance pF -power mW",
            f"create_clock -name clock -period {1e3 / megahertz:.6f} [get_ports {CLOCK}]",
            f"set_clock_transition {slew:.6f} [get_clocks clock]",
            "read_saif -scope unit unit.saif",
            "report_power -digits 6",
        ],
        liberties,
        list(_verilog(netlist)),
        list(_saif(netlist, activity, 1e6 / megahertz)),
    )
    total = re.search(r"^Total\s+(?:[\d.eE+-]+\s+){3}([\d.eE+-]+)", said, re.MULTILINE)
    return float(total[1]) * (1e3 if "Watts)" in said and "mWatts" not in said else 1.0) if total else None


def _linked(liberties: Sequence[Path]) -> list[str]:
    reads = [f"read_liberty {_link(number, file)}" for number, file in enumerate(liberties)]
    return [*reads, "read_verilog unit.v", "link_design unit"]


def _link(number: int, file: Path) -> str:
    """The file's name in the script's folder: its own may hold what Tcl would take for a command."""
    return f"library{number}{'.lib.gz' if file.suffix == '.gz' else '.lib'}"


def _run(script: Sequence[str], liberties: Sequence[Path], verilog: Sequence[str], saif: Sequence[str] = ()) -> str:
    """What OpenSTA prints."""
    with temporary_folder() as folder:
        for number, file in enumerate(liberties):
            (folder / _link(number, file)).symlink_to(file.resolve())
        for name, lines in (("script.tcl", [*script, "exit"]), ("unit.v", verilog), ("unit.saif", saif)):
            (folder / name).write_text("\n".join(lines) + "\n")
        done = processes.run(["sta", "-no_splash", "-exit", "script.tcl"], cwd=folder)
    return done.stdout


def _verilog(netlist: Netlist) -> Iterator[str]:
    """Nets by number, ports bit by bit; of a port's name nothing but the clock's matters."""
    (clock,) = netlist.inputs[CLOCK]
    ports = dict.fromkeys(sorted(netlist.read_outside), "output") | dict.fromkeys(netlist.driven_outside, "input")

    def name(bit: Bit) -> str:
        return f"1'b{bit:d}" if isinstance(bit, bool) else CLOCK if bit == clock else f"n{bit}"

    yield f"module unit ({', '.join(map(name, ports))});"
    yield from (f"  {direction} {name(net)};" for net, direction in ports.items())
    yield from (f"  assign {name(net)} = {name(value)};" for net, value in netlist.ties.items())
    for number, instance in enumerate(netlist.instances):
        wires: dict[str, Bit] = {**instance.nets, **instance.ties}
        pins = ", ".join(f".{pin}({name(bit)})" for pin, bit in wires.items())
        yield f"  {instance.cell.name} g{number} ({pins});"
    yield "endmodule"


def _saif(netlist: Netlist, activity: Activity, period: float) -> Iterator[str]:
    """Changes of each net, and how long it is high; `period` of the clock in ps."""
    (clock,) = netlist.inputs[CLOCK]
    duration = activity.cycles * period
    yield '(SAIFILE (SAIFVERSION "2.0") (DIRECTION "backward") (DESIGN "unit") (DIVIDER /) (TIMESCALE 1 ps)'
    yield f"(DURATION {duration:.0f}) (INSTANCE unit (NET"
    for net, (changes, high) in enumerate(zip(activity.changes, activity.high, strict=True)):
        times = f"(T0 {duration * (1 - high):.0f}) (T1 {duration * high:.0f}) (TX 0)"
        yield f"({CLOCK if net == clock else f'n{net}'} {times} (TC {changes}) (IG 0))"
    yield ")))"
