"""The ULX3S board with its largest FPGA, an ECP5 with 84,000 LUTs: the pins that the SoC uses, and its clocks.

Pins are from the board's public constraints (github.com/emard/ulx3s, version 2.0).
"""

from __future__ import annotations

from typing import Any

from litex.build.generic_platform import IOStandard, Misc, Pins, Subsignal
from litex.build.io import DDROutput
from litex.build.lattice import LatticeECP5Platform
from litex.gen import LiteXModule
from litex.soc.cores.clock import ECP5PLL
from migen import ClockDomain, ClockSignal, Signal

#: Of the oscillator, in Hz.
OSCILLATOR = 25e6

_LVCMOS33 = IOStandard("LVCMOS33")
_IO = [
    ("clk25", 0, Pins("G2"), _LVCMOS33),
    ("rst", 0, Pins("R1"), _LVCMOS33, Misc("PULLMODE=DOWN")),
    ("wifi_gpio0", 0, Pins("L2"), _LVCMOS33),
    ("serial", 0, Subsignal("tx", Pins("L4"), _LVCMOS33), Subsignal("rx", Pins("M1"), _LVCMOS33)),
    *(("user_led", index, Pins(pin), _LVCMOS33) for index, pin in enumerate("B2 C2 C1 D2 D1 E2 E1 H3".split())),
    ("sdram_clock", 0, Pins("F19"), _LVCMOS33),
    (
        "sdram", 0,
        Subsignal("a", Pins("M20 M19 L20 L19 K20 K19 K18 J20 J19 H20 N19 G20 G19")),
        Subsignal("dq", Pins("J16 L18 M18 N18 P18 T18 T17 U20 E19 D20 D19 C20 E18 F18 J18 J17")),
        Subsignal("we_n", Pins("T20")),
        Subsignal("ras_n", Pins("R20")),
        Subsignal("cas_n", Pins("T19")),
        Subsignal("cs_n", Pins("P20")),
        Subsignal("cke", Pins("F20")),
        Subsignal("ba", Pins("P19 N20")),
        Subsignal("dm", Pins("U19 E20")),
        _LVCMOS33,
        Misc("SLEWRATE=FAST"),
    ),
]  # fmt: skip


class Platform(LatticeECP5Platform):  # type: ignore[misc]
    """The board."""

    default_clk_name = "clk25"
    default_clk_period = 1e9 / OSCILLATOR

    def __init__(self) -> None:
        LatticeECP5Platform.__init__(self, "LFE5U-85F-6BG381C", _IO, toolchain="trellis")

    def do_finalize(self, fragment: Any) -> None:
        """Tell nextpnr the oscillator's frequency."""
        LatticeECP5Platform.do_finalize(self, fragment)
        self.add_period_constraint(self.lookup_request("clk25", loose=True), self.default_clk_period)


class Clocks(LiteXModule):  # type: ignore[misc]
    """The SoC's clock from a PLL, and the same a quarter of a period later for the SDRAM."""

    def __init__(self, platform: Platform, frequency: float) -> None:
        self.rst = Signal()
        self.cd_sys = ClockDomain()
        self.cd_sys_ps = ClockDomain()
        self.pll = pll = ECP5PLL()
        self.comb += pll.reset.eq(platform.request("rst") | self.rst)
        pll.register_clkin(platform.request("clk25"), OSCILLATOR)
        pll.create_clkout(self.cd_sys, frequency)
        pll.create_clkout(self.cd_sys_ps, frequency, phase=90)
        self.specials += DDROutput(1, 0, platform.request("sdram_clock"), ClockSignal("sys_ps"))
        # Otherwise the board's other processor resets the FPGA
        self.comb += platform.request("wifi_gpio0").eq(1)
