"""Cross-check with OpenSTA, if it is on ``PATH``: the slowest path between registers, and power.

Power needs a version that reads SAIF. Debian's version of 2019 does not, and silently ignores the activity of nets.
"""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path

from colonnade.common import processes
from colonnade.common.temporary import temporary_folder

from colonnade_lab.ppa.library.cells import Library
from colonnade_lab.ppa.netlist.activity import Activity
from colonnade_lab.ppa.netlist.mapped import Bit, Netlist

#: The clock port of each unit.
CLOCK = "clock"


def is_available() -> bool:
    """Whether OpenSTA is on ``PATH``."""
    return shutil.which("sta") is not None


def reads_activities() -> bool:
    """Whether OpenSTA is on ``PATH`` and reads SAIF."""
    return is_available() and "read_saif" in _run(["puts [info commands read_saif]"], (), ())


def register_to_register(netlist: Netlist, library: Library, slew: float, load: float) -> float | None:
    """The slowest path from clock to set-up by OpenSTA, ns; None without such a path.

    Args:
        netlist: The netlist of a unit.
        library: Its cells, from pruned files.
        slew: Slew of the clock, ns.
        load: Load of each output, pF.
    """
    printed = _run(
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
    arrival = re.search(r"([\d.]+)\s+data arrival time", printed)
    setup = re.search(r"(-?[\d.]+)\s+[\d.]+\s+library setup time", printed)
    return float(arrival[1]) - float(setup[1]) if arrival and setup else None


def power(
    netlist: Netlist, liberties: Sequence[Path], activity: Activity, slew: float, megahertz: float
) -> float | None:
    """The total power of the gates by OpenSTA with the activity of each net, mW; None if it reports none.

    Args:
        netlist: The gates.
        liberties: The original files, with energies.
        activity: Activity of the nets.
        slew: Slew of the clock, ns.
        megahertz: Clock frequency, MHz.
    """
    printed = _run(
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
    total = re.search(r"^Total\s+(?:[\d.eE+-]+\s+){3}([\d.eE+-]+)", printed, re.MULTILINE)
    return float(total[1]) * (1e3 if "Watts)" in printed and "mWatts" not in printed else 1.0) if total else None


def _linked(liberties: Sequence[Path]) -> list[str]:
    reads = [f"read_liberty {_link(number, file)}" for number, file in enumerate(liberties)]
    return [*reads, "read_verilog unit.v", "link_design unit"]


def _link(number: int, file: Path) -> str:
    """A safe name for a file in the script's folder, since Tcl could interpret characters of the original name."""
    return f"library{number}{'.lib.gz' if file.suffix == '.gz' else '.lib'}"


def _run(script: Sequence[str], liberties: Sequence[Path], verilog: Sequence[str], saif: Sequence[str] = ()) -> str:
    """Run OpenSTA in a temporary folder, and return its output."""
    with temporary_folder() as folder:
        for number, file in enumerate(liberties):
            (folder / _link(number, file)).symlink_to(file.resolve())
        for name, lines in (("script.tcl", [*script, "exit"]), ("unit.v", verilog), ("unit.saif", saif)):
            (folder / name).write_text("\n".join(lines) + "\n")
        done = processes.run(["sta", "-no_splash", "-exit", "script.tcl"], cwd=folder)
    return done.stdout


def _verilog(netlist: Netlist) -> Iterator[str]:
    """The netlist as Verilog with numbered nets and one-bit ports; only the clock port keeps its name."""
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
    """A SAIF file with the transitions and the high time of each net. `period` is the clock's, ps."""
    (clock,) = netlist.inputs[CLOCK]
    duration = activity.cycles * period
    yield '(SAIFILE (SAIFVERSION "2.0") (DIRECTION "backward") (DESIGN "unit") (DIVIDER /) (TIMESCALE 1 ps)'
    yield f"(DURATION {duration:.0f}) (INSTANCE unit (NET"
    for net, (changes, high) in enumerate(zip(activity.changes, activity.high, strict=True)):
        times = f"(T0 {duration * (1 - high):.0f}) (T1 {duration * high:.0f}) (TX 0)"
        yield f"({CLOCK if net == clock else f'n{net}'} {times} (TC {changes}) (IG 0))"
    yield ")))"
