"""ColonnadeAxi, or the top with AXI4 ports, in cocotb: its registers, a memory, and its image."""

from __future__ import annotations

import json
import os
import time
from pathlib import Path
from typing import Any

from cocotb import start_soon
from cocotb.clock import Clock
from cocotb.triggers import ClockCycles, RisingEdge
from cocotb.utils import get_sim_time
from cocotbext.axi import AxiBus, AxiLiteBus, AxiLiteMaster, AxiMaster, AxiRam, AxiRamRead, AxiReadBus

PERIOD = 10  # ns
IMAGE, SCENE, MEMORY = 0x1000, 0x100000, 1 << 21  # bytes
PAGE = 4096  # bytes of register dram.page
IMAGE_DONE = 2  # interrupt
LOAD = 2  # command


def strobed(data: Any, strobe: int) -> int:
    """The bytes of a beat with a strobe. The others are unknown in Icarus Verilog, behind the last pixel of a line."""
    lanes = (lane for lane in range(len(data) // 8) if strobe >> lane & 1)
    return sum(int(data[8 * lane + 7 : 8 * lane]) << 8 * lane for lane in lanes)


def memory_of(dut: Any) -> AxiRam:
    """A memory on ``m_axi``, and on ``m_axi_scene`` if the design has it."""
    bus = AxiBus.from_prefix(dut, "m_axi")
    memory = AxiRam(bus, dut.clock, dut.reset, size=MEMORY)
    bus.read.r.rid.value = bus.write.b.bid.value = 0  # rready and bready depend on them
    data = memory.write_if.w_channel
    receive = data.recv

    async def received() -> Any:
        beat = await receive()
        beat.wdata = strobed(beat.wdata, int(beat.wstrb))
        return beat

    data.recv = received
    if hasattr(dut, "m_axi_scene_arvalid"):
        scene = AxiReadBus.from_prefix(dut, "m_axi_scene")
        AxiRamRead(scene, dut.clock, dut.reset, size=MEMORY, mem=memory.mem)
        scene.r.rid.value = 0
    return memory


def cycles_since(begin: float) -> int:
    """Cycles since a time of the simulation, ns."""
    return round((get_sim_time("ns") - begin) / PERIOD)


class Device:
    """The registers of the shell, by the names of ``shell.json``, and the device's behind them."""

    def __init__(self, dut: Any, design: Path) -> None:
        shell = json.loads((design / "shell.json").read_text())
        manifest = json.loads((design / "manifest.json").read_text())
        self.registers = {register["name"]: register for register in shell["registers"]}
        self.base = shell["deviceBase"]
        fields = manifest["registers"]["fields"]
        self.addresses = {field["name"]: self.base + 4 * field["address"] for field in fields}
        self.errors = [field["address"] for field in fields if field["name"].startswith("errors.")]
        self.tile = manifest["config"]["frame"]["tileSize"]
        self.dut = dut
        self.access: dict[str, int] = {}
        if hasattr(dut, "s_axil_awvalid"):
            self.bus = AxiLiteMaster(AxiLiteBus.from_prefix(dut, "s_axil"), dut.clock, dut.reset)
        else:
            self.bus = AxiMaster(AxiBus.from_prefix(dut, "s_axi"), dut.clock, dut.reset)
            self.access = {"size": 2}  # accesses of 4 bytes

    async def write(self, address: int, value: int) -> None:
        """Write a word, which the shell must take."""
        response = await self.bus.write(address, value.to_bytes(4, "little"), **self.access)
        assert response.resp == 0, f"the shell refuses a write to {address:#x}"

    async def read(self, address: int) -> int:
        """Read a word, which the shell must have."""
        response = await self.bus.read(address, 4, **self.access)
        assert response.resp == 0, f"the shell refuses a read of {address:#x}"
        return int.from_bytes(response.data, "little")

    async def set(self, name: str, value: int) -> None:
        """Write a register of the shell, the low word first."""
        register = self.registers[name]
        for word in range(-(-register["width"] // 32)):
            await self.write(register["address"] + 4 * word, value >> 32 * word & 0xFFFFFFFF)

    async def get(self, name: str) -> int:
        """Read a register of the shell, of one word."""
        return await self.read(self.registers[name]["address"])

    async def interrupt(self) -> None:
        """Wait for the interrupt."""
        if self.dut.irq.value != 1:
            await RisingEdge(self.dut.irq)

    async def run(self, command: int, event: int) -> int:
        """Start something and wait for its interrupt: the cycles it took."""
        await self.set("interrupt.status", 7)
        await self.set("interrupt.enable", event)
        begin = get_sim_time("ns")
        await self.set("control", command)
        await self.interrupt()
        return cycles_since(begin)

    async def reset(self) -> None:
        """Reset the device, and find it."""
        self.dut.reset.value = 1
        await ClockCycles(self.dut.clock, 10)
        self.dut.reset.value = 0
        await ClockCycles(self.dut.clock, 2)
        assert await self.get("identity") == 0x434C4E44

    async def require_no_errors(self) -> None:
        """Fail if the device has an error."""
        for address in self.errors:
            assert await self.read(self.base + 4 * address) == 0


class Job:
    """A device with its memory, and the files of a job, which come from the environment: see run.py."""

    def __init__(self, dut: Any, *names: str) -> None:
        self._begin = time.process_time()
        self.files = {name: Path(os.environ[name]) for name in ("DESIGN", "IMAGE", "OUTPUT", *names)}
        start_soon(Clock(dut.clock, PERIOD, unit="ns").start())
        self.device = Device(dut, self.files["DESIGN"])
        self.memory = memory_of(dut)

    async def load(self) -> None:
        """Load the device image through the bus."""
        image = self.files["IMAGE"].read_bytes()
        self.memory.write(IMAGE, image)
        window = {"base": IMAGE, "windowBase": IMAGE, "windowEnd": IMAGE + len(image), "bytes": len(image)}
        for name, value in window.items():
            await self.device.set(f"image.{name}", value)
        print(f"load: {await self.device.run(LOAD, IMAGE_DONE)} cycles")
        assert await self.device.get("image.errors") == 0

    async def set_scene(self) -> None:
        """Store the records of a design that reads them from DRAM, and say where they are."""
        if "dram.page" in self.device.addresses:
            self.memory.write(SCENE, Path(os.environ["SCENE"]).read_bytes())
            await self.device.write(self.device.addresses["dram.page"], SCENE // PAGE)

    def end(self, output: bytes) -> None:
        """Write the output, and print the speed of the simulation."""
        self.files["OUTPUT"].write_bytes(output)
        cycles, seconds = cycles_since(0), time.process_time() - self._begin
        print(f"speed: {cycles} cycles in {seconds:.2f} s of the processor, {cycles / seconds:.0f} cycles/s")
