"""OpenSTA, where it is on ``PATH``, as a second opinion on the slowest path between registers."""

from __future__ import annotations

import re
import shutil
import subprocess
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from colonnade.ppa.cells import Library

#: The clock's port in every unit.
CLOCK = "clock"


def is_there() -> bool:
    """There is an OpenSTA to ask."""
    return shutil.which("sta") is not None


def register_to_register(module: Mapping[str, Any], library: Library, slew: float, load: float) -> float | None:
    """The slowest path from clock to set-up in ns, by OpenSTA; None where there is no such path.

    Args:
        module: a unit in Yosys's JSON.
        library: its cells, from pruned files.
        slew: of the clock, in ns.
        load: of every output, in pF.
    """
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        (folder / "unit.v").write_text("\n".join(_verilog(module, library)))
        script = [f"read_liberty {{{file}}}" for file in library.files]
        script += [
            "read_verilog unit.v",
            "link_design unit",
            "set_cmd_units -time ns -capacitance pF",
            f"create_clock -name clock -period 1000 [get_ports {CLOCK}]",
            f"set_clock_transition {slew:.6f} [get_clocks clock]",
            f"set_load {load:.6f} [all_outputs]",
            "report_checks -path_delay max -from [all_registers -clock_pins] -to [all_registers -data_pins] -digits 6",
            "exit",
        ]
        (folder / "script.tcl").write_text("\n".join(script) + "\n")
        command = ["sta", "-no_splash", "-exit", "script.tcl"]
        done = subprocess.run(
            command, cwd=folder, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False
        )
    arrival = re.search(r"([\d.]+)\s+data arrival time", done.stdout)
    setup = re.search(r"(-?[\d.]+)\s+[\d.]+\s+library setup time", done.stdout)
    return float(arrival[1]) - float(setup[1]) if arrival and setup else None


def _verilog(module: Mapping[str, Any], library: Library) -> Iterator[str]:
    """Nets by number, ports bit by bit; of a port's name nothing but the clock's matters."""
    ports: dict[int, str] = {}
    for port in module["ports"].values():
        ports |= {bit: port["direction"] for bit in port["bits"] if isinstance(bit, int)}
    # What black boxes drive and read is outside, too
    for box in module["cells"].values():
        if box["type"] not in library.cells:
            for pin, bits in box["connections"].items():
                direction = "input" if box["port_directions"][pin] == "output" else "output"
                for bit in bits:
                    if isinstance(bit, int):
                        ports.setdefault(bit, direction)
    clock = module["ports"][CLOCK]["bits"][0]
    names = {bit: CLOCK if bit == clock else f"n{bit}" for bit in ports}
    yield f"module unit ({', '.join(names.values())});"
    yield from (f"  {direction} {names[bit]};" for bit, direction in ports.items())
    for number, cell in enumerate(module["cells"].values()):
        if cell["type"] in library.cells:
            pins = (
                f".{pin}({(names.get(bits[0], f'n{bits[0]}') if isinstance(bits[0], int) else _constant(bits[0]))})"
                for pin, bits in cell["connections"].items()
                if bits
            )
            yield f"  {cell['type']} g{number} ({', '.join(pins)});"
    yield "endmodule\n"


def _constant(bit: str) -> str:
    return "1'b1" if bit == "1" else "1'b0"
