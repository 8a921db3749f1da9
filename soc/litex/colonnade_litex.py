"""Colonnade in a LiteX SoC: registers on the SoC's bus, images and framebuffers in its memory, an interrupt.

colonnade generate --config tiny --axi 4 --output out/tiny
self.colonnade = Colonnade(platform, "out/tiny")
self.colonnade.attach(self, "colonnade", 0x9000_0000)
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from litex.gen import LiteXModule
from litex.soc.integration.soc import SoCRegion
from litex.soc.interconnect import axi
from migen import ClockSignal, Instance, Module, ResetSignal, Signal

REGISTER_BYTES = 0x10000

#: Signals of a channel that the device has, under the names of AXI.
_LITE = {
    "aw": ("valid", "ready", "addr", "prot"),
    "w": ("valid", "ready", "data", "strb"),
    "b": ("valid", "ready", "resp"),
    "ar": ("valid", "ready", "addr", "prot"),
    "r": ("valid", "ready", "data", "resp"),
}
_FULL = {
    "aw": ("valid", "ready", "addr", "id", "len", "size", "burst", "prot"),
    "w": ("valid", "ready", "data", "strb", "last"),
    "b": ("valid", "ready", "resp", "id"),
    "ar": ("valid", "ready", "addr", "id", "len", "size", "burst", "prot"),
    "r": ("valid", "ready", "data", "resp", "id", "last"),
}


class _Interrupt(Module):  # type: ignore[misc]
    """What LiteX expects of an interrupt's source."""

    def __init__(self) -> None:
        self.irq = Signal()


class Colonnade(LiteXModule):  # type: ignore[misc]
    """The top module ColonnadeAxi of a generated design.

    Attributes:
        registers: AXI4-Lite slave, 32 bits.
        memory: AXI4 master, as wide as the design's bus.
        scene: AXI4 master that reads a scene in DRAM, as wide as the caches' bus; None if the scene is on chip.
        ev: The interrupt.
    """

    def __init__(self, platform: Any, design: str | Path) -> None:
        folder = Path(design)
        width = 8 * int(json.loads((folder / "shell.json").read_text())["busBytes"])
        config = json.loads((folder / "manifest.json").read_text())["config"]
        records = config["columnBvhMemory"]
        # A device for rays has an identifier for each column, and one for its batches
        identifiers = int(config["array"]["columns"]).bit_length() if config.get("queries") else 1
        self.registers = axi.AXILiteInterface(data_width=32, address_width=32)
        self.memory = axi.AXIInterface(data_width=width, address_width=32, id_width=identifiers)
        self.ev = _Interrupt()
        ports = {"i_clock": ClockSignal("sys"), "i_reset": ResetSignal("sys"), "o_irq": self.ev.irq}
        ports |= _ports("s_axil", self.registers, _LITE, is_slave=True)
        ports |= _ports("m_axi", self.memory, _FULL, is_slave=False)
        self.scene = None
        if records["cache"]:
            identifiers = max(1, (records["banks"] - 1).bit_length())
            width = 8 * records["cache"]["busBytes"]
            self.scene = axi.AXIInterface(data_width=width, address_width=32, id_width=identifiers)
            reads = {channel: _FULL[channel] for channel in ("ar", "r")}
            ports |= _ports("m_axi_scene", self.scene, reads, is_slave=False)
        self.specials += Instance("ColonnadeAxi", **ports)
        for name in (folder / "filelist.f").read_text().split():
            platform.add_source(str((folder / name).resolve()), "systemverilog")

    def attach(self, soc: Any, name: str, origin: int, *, masters_on_bus: bool = True) -> None:
        """Put the registers at ``origin``, where the processor does not cache, and connect masters and interrupt.

        Without ``masters_on_bus`` the caller connects :attr:`memory` and :attr:`scene`, for example to ports of the
        memory's controller.
        """
        soc.bus.add_slave(name, self.registers, SoCRegion(origin=origin, size=REGISTER_BYTES, cached=False))
        if masters_on_bus:
            # LiteX's converter holds the id of a beat for one cycle; a device for rays takes each beat at once
            soc.bus.add_master(name=name, master=self.memory)
            if self.scene is not None:
                soc.bus.add_master(name=f"{name}_scene", master=self.scene)
        if soc.irq.enabled:
            soc.irq.add(name, use_loc_if_exists=True)


def _ports(prefix: str, interface: Any, channels: dict[str, tuple[str, ...]], is_slave: bool) -> dict[str, Any]:
    """Connections of an instance. Requests go into a slave, answers out of it, and ``ready`` the other way."""
    ports = {}
    for channel, signals in channels.items():
        for signal in signals:
            goes_in = (channel in ("aw", "w", "ar")) == (signal != "ready")
            direction = "i" if goes_in == is_slave else "o"
            value = getattr(getattr(interface, channel), signal)
            ports[f"{direction}_{prefix}_{channel}{signal}"] = value[:16] if signal == "addr" and is_slave else value
    return ports
