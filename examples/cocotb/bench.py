"""A bench of ColonnadeAxi, or of the top with AXI4 ports, in cocotb: a frame in a memory, whose lines go to a file."""

from __future__ import annotations

import json
import os
import struct
import time
from pathlib import Path
from typing import Any

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import ClockCycles, RisingEdge
from cocotb.utils import get_sim_time
from cocotbext.axi import AxiBus, AxiLiteBus, AxiLiteMaster, AxiMaster, AxiRam, AxiRamRead, AxiReadBus

PERIOD = 10  # ns
IMAGE, FRAMEBUFFER, SCENE, MEMORY = 0x1000, 0x80000, 0x100000, 1 << 21  # bytes
PAGE = 4096  # bytes of register dram.page
FRAME_DONE, IMAGE_DONE = 1, 2  # interrupts
START, LOAD = 1, 2  # commands


def strobed(data: Any, strobe: int) -> int:
    """The bytes of a beat with a strobe. The others are unknown in Icarus Verilog, behind the last pixel of a line."""
    lanes = (lane for lane in range(len(data) // 8) if strobe >> lane & 1)
    return sum(int(data[8 * lane + 7 : 8 * lane]) << 8 * lane for lane in lanes)


def memory_of(dut: Any) -> AxiRam:
    """A memory on ``m_axi``, and on ``m_axi_scene`` if the design has it."""
    memory = AxiRam(AxiBus.from_prefix(dut, "m_axi"), dut.clock, dut.reset, size=MEMORY)
    data = memory.write_if.w_channel
    receive = data.recv

    async def received() -> Any:
        beat = await receive()
        beat.wdata = strobed(beat.wdata, int(beat.wstrb))
        return beat

    data.recv = received
    if hasattr(dut, "m_axi_scene_arvalid"):
        bus = AxiReadBus.from_prefix(dut, "m_axi_scene")
        bus.r.rid.value = 0  # rready depends on it
        AxiRamRead(bus, dut.clock, dut.reset, size=MEMORY, mem=memory.mem)
    return memory


class Device:
    """The registers of the shell, by the names of ``shell.json``, and those of the device behind them."""

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

    async def run(self, command: int, event: int) -> int:
        """Start something and wait for its interrupt: the cycles it took."""
        await self.set("interrupt.status", 7)
        await self.set("interrupt.enable", event)
        begin = get_sim_time("ns")
        await self.set("control", command)
        if self.dut.irq.value != 1:
            await RisingEdge(self.dut.irq)
        return round((get_sim_time("ns") - begin) / PERIOD)


@cocotb.test(timeout_time=10, timeout_unit="ms")
async def renders_a_frame(dut: Any) -> None:
    """Files come from the environment: see run.py."""
    files = {name: Path(os.environ[name]) for name in ("DESIGN", "IMAGE", "FRAME", "OUTPUT")}
    begin = time.process_time()
    cocotb.start_soon(Clock(dut.clock, PERIOD, unit="ns").start())
    device = Device(dut, files["DESIGN"])
    memory = memory_of(dut)
    dut.reset.value = 1
    await ClockCycles(dut.clock, 10)
    dut.reset.value = 0
    await ClockCycles(dut.clock, 2)
    assert await device.get("identity") == 0x434C4E44

    if "backdoor" not in cocotb.plusargs:
        image = files["IMAGE"].read_bytes()
        assert IMAGE + len(image) <= FRAMEBUFFER
        memory.write(IMAGE, image)
        window = {
            "base": IMAGE,
            "windowBase": IMAGE,
            "windowEnd": IMAGE + len(image),
            "bytes": len(image),
        }
        for name, value in window.items():
            await device.set(f"image.{name}", value)
        print(f"load: {await device.run(LOAD, IMAGE_DONE)} cycles")
        assert await device.get("image.errors") == 0

    # The words of a frame file: docs/driver.md
    words = [word for (word,) in struct.iter_unpack("<I", files["FRAME"].read_bytes())]
    width, height, count = words[12:15]
    for address, value in zip(words[16::2], words[17::2], strict=True):
        await device.write(device.base + 4 * address, value)
    assert len(words) == 16 + 2 * count
    if "dram.page" in device.addresses:
        memory.write(SCENE, Path(os.environ["SCENE"]).read_bytes())
        await device.write(device.addresses["dram.page"], SCENE // PAGE)
    stride = -(-width // device.tile) * device.tile * 4
    end = FRAMEBUFFER + stride * height
    assert end <= SCENE
    window = {
        "base": FRAMEBUFFER,
        "windowBase": FRAMEBUFFER,
        "windowEnd": end,
        "stride": stride,
        "format": 0,
    }
    for name, value in window.items():
        await device.set(f"framebuffer.{name}", value)
    print(f"frame: {await device.run(START, FRAME_DONE)} cycles")
    assert await device.get("framebuffer.errors") == 0
    for address in device.errors:
        assert await device.read(device.base + 4 * address) == 0
    lines = (memory.read(FRAMEBUFFER + stride * line, 4 * width) for line in range(height))
    files["OUTPUT"].write_bytes(b"".join(lines))
    cycles, seconds = round(get_sim_time("ns") / PERIOD), time.process_time() - begin
    print(f"speed: {cycles} cycles in {seconds:.2f} s of the processor, {cycles / seconds:.0f} cycles/s")
