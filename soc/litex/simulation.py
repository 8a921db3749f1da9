"""A SoC in LiteX's simulator: VexRiscv, main memory, console, Colonnade, and a program (docs/soc.md).

Usage: simulation.py PROGRAM DESIGN REGISTERS OUTPUT CONSOLE NAME=FILE …

PROGRAM is frames or rays. DESIGN and REGISTERS are folders of ``colonnade generate --axi`` and ``colonnade registers``.
Each FILE is put into the main memory. OUTPUT receives the build, gateware/memory.hex, and layout.json, which says where
things are in it. CONSOLE is a file for what the SoC prints.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from colonnade_litex import Colonnade
from layouts import MAIN_RAM, MAIN_RAM_BYTES, PROGRAM_BYTES, PROGRAMS, UNWRITTEN, memory_layout
from litex.build.generic_platform import Pins, Subsignal
from litex.build.io import CRG
from litex.build.sim import SimPlatform
from litex.build.sim.config import SimConfig
from litex.soc.integration.builder import Builder
from litex.soc.integration.common import get_mem_data
from litex.soc.integration.soc_core import SoCCore
from litex.soc.interconnect.csr import AutoCSR, CSRStorage
from migen import ClockSignal, Instance, Module

HERE = Path(__file__).resolve().parent
FREQUENCY = 1_000_000
REGISTERS = 0x9000_0000
#: Of host time, for the simulation.
SECONDS = 3600

_UART = ("source_valid", "source_ready", "sink_valid", "sink_ready")
_IO = [
    ("sys_clk", 0, Pins(1)),
    ("sys_rst", 0, Pins(1)),
    (
        "serial", 0, *(Subsignal(name, Pins(1)) for name in _UART),
        Subsignal("source_data", Pins(8)), Subsignal("sink_data", Pins(8)),
    ),
]  # fmt: skip


class Simulation(Module, AutoCSR):  # type: ignore[misc]
    """A register that ends the simulation."""

    def __init__(self, platform: Any) -> None:
        self.finish = CSRStorage()
        self.specials += Instance("MemoryDump", i_clock=ClockSignal("sys"), i_finish=self.finish.storage)
        platform.add_source(str(HERE / "memory_dump.sv"), "systemverilog")


class SoC(SoCCore):  # type: ignore[misc]
    """VexRiscv, 64 KB of ROM with LiteX's BIOS, main memory, timer, console, Colonnade."""

    def __init__(self, design: Path) -> None:
        platform = SimPlatform("SIM", _IO)
        self.crg = CRG(platform.request("sys_clk"))
        SoCCore.__init__(
            self, platform, clk_freq=FREQUENCY, ident="Colonnade in LiteX", cpu_type="vexriscv", uart_name="sim",
            integrated_rom_size=0x10000, integrated_sram_size=0x2000, integrated_main_ram_size=MAIN_RAM_BYTES,
        )  # fmt: skip
        self.add_constant("ROM_BOOT_ADDRESS", MAIN_RAM)
        for name in ("BIOS_NO_PROMPT", "BIOS_NO_DELAYS", "BIOS_NO_CRC", "MAIN_RAM_INIT"):
            self.add_config(name)
        self.colonnade = Colonnade(platform, design)
        self.colonnade.attach(self, "colonnade", REGISTERS)
        self.simulation = Simulation(platform)


class ProgramBuilder(Builder):  # type: ignore[misc]
    """Also compiles a program, and puts it and its files into the main memory."""

    def __init__(
        self,
        soc: SoC,
        program: str,
        registers: Path,
        layout: dict[str, int],
        files: dict[str, bytes],
        output: Path,
    ) -> None:
        Builder.__init__(self, soc, output_dir=str(output))
        self.program, self.registers, self.layout, self.files = program, registers, layout, files
        self.output = output

    def _initialize_rom_software(self) -> None:
        Builder._initialize_rom_software(self)
        folder = self.output / "program"
        folder.mkdir(exist_ok=True)
        defines = [f"#define {name.upper()} {value:#x}u\n" for name, value in self.layout.items()]
        (folder / "layout.h").write_text("".join(defines))
        variables = [f"BUILD_DIR={self.output}", f"DESIGN={self.registers}", f"PROGRAM={HERE / 'program'}"]
        variables.append(f"MAIN={self.program}")
        subprocess.run(["make", "-C", folder, "-f", HERE / "program" / "Makefile", *variables], check=True)
        program = (folder / "program.bin").read_bytes()
        if len(program) > PROGRAM_BYTES:
            raise SystemExit(f"the program has {len(program)} bytes, there is room for {PROGRAM_BYTES}")
        memory = bytearray([UNWRITTEN] * MAIN_RAM_BYTES)
        memory[: len(program)] = program
        for name, content in self.files.items():
            start = self.layout[name] - MAIN_RAM
            memory[start : start + len(content)] = content
        (folder / "memory.bin").write_bytes(memory)
        words = get_mem_data(str(folder / "memory.bin"), data_width=32, endianness="little")
        self.soc.init_ram("main_ram", contents=words)


def main() -> None:
    """Build, simulate."""
    if len(sys.argv) < 6 or sys.argv[1] not in PROGRAMS:
        raise SystemExit(__doc__)
    program, *arguments = sys.argv[1:]
    design, registers, output, console = (Path(argument).resolve() for argument in arguments[:4])
    files = {name: Path(file).read_bytes() for name, _, file in (each.partition("=") for each in arguments[4:])}
    layout = memory_layout(program, files)
    output.mkdir(parents=True, exist_ok=True)
    (output / "layout.json").write_text(json.dumps(layout, indent=1) + "\n")
    gateware = output / "gateware"
    (gateware / "memory.hex").unlink(missing_ok=True)
    # LiteX's makefiles call python3 and expect LiteX there
    os.environ["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    # Vectorised population counts of Verilator are wrong with some versions of g++
    os.environ["CFLAGS"] = "-fno-tree-slp-vectorize"
    configuration = SimConfig()
    configuration.add_clocker("sys_clk", freq_hz=FREQUENCY)
    configuration.add_module("serial2console", "serial")
    builder = ProgramBuilder(SoC(design), program, registers, layout, files, output)
    builder.build(sim_config=configuration, run=False, opt_level="O3")
    subprocess.run(["bash", "build_sim.sh"], cwd=gateware, check=True)
    with console.open("wb") as stream:
        subprocess.run(["obj_dir/Vsim"], cwd=gateware, stdout=stream, check=True, timeout=SECONDS)
    if not (gateware / "memory.hex").is_file():
        raise SystemExit("the simulation ended before the program")


if __name__ == "__main__":
    main()
