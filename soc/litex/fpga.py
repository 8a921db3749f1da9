"""A SoC for the ULX3S board: VexRiscv, SDRAM, serial port, Colonnade with its scene in SDRAM (docs/soc.md).

Usage: fpga.py DESIGN FREQUENCY OUTPUT

DESIGN is a folder of ``colonnade generate --axi 4`` with a cache whose bus has 4 bytes, FREQUENCY the clock's in
Hz. OUTPUT receives LiteX's build and sources.json, which says what is to be synthesised.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

from colonnade_litex import Colonnade
from litedram.core import ControllerSettings
from litedram.frontend.axi import LiteDRAMAXI2Native
from litedram.modules import MT48LC16M16
from litedram.phy import GENSDRPHY
from litex.soc.integration.builder import Builder
from litex.soc.integration.soc_core import SoCCore
from ulx3s import Clocks, Platform

REGISTERS = 0x9000_0000
NAME = "colonnade_ulx3s"


class SoC(SoCCore):  # type: ignore[misc]
    """VexRiscv, ROM with LiteX's BIOS, SDRAM, timer, serial port, Colonnade.

    Each of Colonnade's masters has a port of its own of the SDRAM's controller. No cache lies between the bus and the
    SDRAM; the processor's own one writes through.
    """

    def __init__(self, design: Path, frequency: float) -> None:
        platform = Platform()
        self.crg = Clocks(platform, frequency)
        SoCCore.__init__(
            self, platform, clk_freq=frequency, ident="Colonnade on ULX3S", cpu_type="vexriscv",
            integrated_rom_size=0x10000, integrated_sram_size=0x2000,
        )  # fmt: skip
        self.sdrphy = GENSDRPHY(platform.request("sdram"), frequency)
        # Buffered commands, for timing
        self.add_sdram(
            "sdram", phy=self.sdrphy, module=MT48LC16M16(frequency, "1:1"), l2_cache_size=0,
            controller_settings=ControllerSettings(cmd_buffer_buffered=True),
        )  # fmt: skip
        self.colonnade = Colonnade(platform, design)
        self.colonnade.attach(self, "colonnade", REGISTERS, masters_on_bus=False)
        origin = self.bus.regions["main_ram"].origin
        for name in ("memory", "scene"):
            master = getattr(self.colonnade, name)
            port = self.sdram.crossbar.get_port(data_width=master.data_width)
            self.add_module(f"{name}_port", LiteDRAMAXI2Native(master, port, base_address=origin))


def main() -> None:
    """Write the Verilog of the SoC, with the BIOS in its ROM, and compile nothing else."""
    if len(sys.argv) != 4:
        raise SystemExit(__doc__)
    design, output = Path(sys.argv[1]).resolve(), Path(sys.argv[3]).resolve()
    # LiteX's makefiles call python3 and expect LiteX there
    os.environ["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    soc = SoC(design, float(sys.argv[2]))
    Builder(soc, output_dir=str(output)).build(run=False, build_name=NAME)
    sources = [(str(Path(file).resolve()), language) for file, language, *_ in soc.platform.sources]
    region = soc.bus.regions["main_ram"]
    (output / "sources.json").write_text(
        json.dumps(
            {"top": NAME, "sources": sources, "main_ram": region.origin, "main_ram_bytes": region.size}, indent=1
        )
    )


if __name__ == "__main__":
    main()
