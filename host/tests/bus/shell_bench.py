"""Tests of ColonnadeAxi that run in the simulator; test_cocotb.py starts them, and hands over the job."""

from __future__ import annotations

import json
import os
import random
from pathlib import Path
from typing import Any

import cocotb
from axi_memory import OKAY, SLVERR, UNWRITTEN, AxiMemory, stalls
from axi_rules import watch
from cocotb.clock import Clock
from cocotb.triggers import ClockCycles, Combine, RisingEdge
from cocotb.types import LogicArray
from cocotbext.axi import AxiLiteBus, AxiLiteMaster

PERIOD = 10
#: Addresses.
IMAGE, FRAMEBUFFER = 0x1000, 0x80000
#: Cycles after which a test fails.
PATIENCE = 100_000
FRAME_DONE, IMAGE_DONE, ERROR = 1, 2, 4
START, LOAD, RESET = 1, 2, 4
IS_RUNNING, IS_LOADING = 1, 4
RESPONSE = 2  # of framebuffer.errors and of image.errors


class Shell:
    """The design, a host that accesses its registers, and a memory."""

    def __init__(self, dut: Any, stall: int = 30, latency: int = 30) -> None:
        folder = Path(os.environ["COLONNADE_JOB"])
        self.job = json.loads((folder / "job.json").read_text())
        self.image = (folder / "image").read_bytes()
        self.expected = (folder / "expected").read_bytes()
        self.registers = {
            register["name"]: register for register in json.loads((folder / "shell.json").read_text())["registers"]
        }
        self.random = random.Random(self.job["seed"])
        self.dut = dut
        dut.reset.value = 1
        cocotb.start_soon(Clock(dut.clock, PERIOD, unit="ns").start())
        self.windows: list[range] = []
        scene = (folder / "scene").read_bytes()
        self.places = {"image": IMAGE, "framebuffer": FRAMEBUFFER, "scene": self.job["scenePlace"]}
        self.memory = AxiMemory(dut, self.job["scenePlace"] + len(scene), stall, latency, self.job["seed"])
        self._store("image", self.image)
        self._store("scene", scene)
        self.host = AxiLiteMaster(AxiLiteBus.from_prefix(dut, "s_axil"), dut.clock, dut.reset)
        write, read = self.host.write_if, self.host.read_if
        for channel in (write.aw_channel, write.w_channel, write.b_channel, read.ar_channel, read.r_channel):
            channel.set_pause_generator(stalls(stall, self.random.getrandbits(32)))
        self.has_scene_port = hasattr(dut, "m_axi_scene_arvalid")
        watch(dut, self.windows, self.has_scene_port)

    def _store(self, name: str, content: bytes) -> None:
        place = self.places[name]
        self.memory.bytes[place : place + len(content)] = content
        self.windows.append(range(place, place + len(content)))

    async def begin(self) -> None:
        await ClockCycles(self.dut.clock, 10)
        self.dut.reset.value = 0
        await ClockCycles(self.dut.clock, 2)

    async def write(self, address: int, value: int) -> int:
        """The response."""
        return int((await self.host.write(address, value.to_bytes(4, "little"))).resp)

    async def read(self, address: int) -> tuple[int, int]:
        """Value and response."""
        answer = await self.host.read(address, 4)
        return int.from_bytes(answer.data, "little"), int(answer.resp)

    async def set(self, name: str, value: int) -> None:
        """Write a register of the shell, which must take it."""
        register = self.registers[name]
        for word in range(-(-register["width"] // 32)):
            assert await self.write(register["address"] + 4 * word, value >> 32 * word & 0xFFFFFFFF) == OKAY, name

    async def get(self, name: str) -> int:
        """Read a register of the shell, of one word."""
        value, response = await self.read(self.registers[name]["address"])
        assert response == OKAY, name
        return value

    async def command(self, code: int, event: int) -> int:
        """Start something and wait for its interrupt; the events that have come."""
        await self.set("interrupt.status", 7)
        await self.set("interrupt.enable", event)
        await self.set("control", code)
        if str(self.dut.irq.value) != "1":
            await RisingEdge(self.dut.irq)
        return await self.get("interrupt.status")

    async def load(self) -> int:
        """Load the image; ``image.errors``."""
        place, size = self.places["image"], len(self.image)
        for name, value in {"base": place, "windowBase": place, "windowEnd": place + size, "bytes": size}.items():
            await self.set(f"image.{name}", value)
        events = await self.command(LOAD, IMAGE_DONE)
        errors = await self.get("image.errors")
        assert events == (IMAGE_DONE | ERROR if errors else IMAGE_DONE)
        return errors

    async def set_frame(self) -> None:
        """Set the registers of a frame, and its framebuffer."""
        for address, value in self.job["frame"]:
            assert await self.write(address, value) == OKAY, hex(address)
        place, end = self.places["framebuffer"], self.places["framebuffer"] + len(self.expected)
        self.windows.append(range(place, end))
        settings = {
            "base": place,
            "windowBase": place,
            "windowEnd": end,
            "stride": self.job["stride"],
            "format": self.job["format"],
        }
        for name, value in settings.items():
            await self.set(f"framebuffer.{name}", value)

    async def frame(self) -> tuple[int, list[int], bytes]:
        """Render a frame: ``framebuffer.errors``, the values of the device's error registers, and the framebuffer."""
        place, size = self.places["framebuffer"], len(self.expected)
        self.memory.bytes[place : place + size] = bytes([UNWRITTEN]) * size
        events = await self.command(START, FRAME_DONE)
        errors = await self.get("framebuffer.errors")
        assert events == (FRAME_DONE | ERROR if errors else FRAME_DONE)
        device = [(await self.read(address))[0] for address in self.job["errors"]]
        return errors, device, bytes(self.memory.bytes[place : place + size])

    async def interrupt(self, command: int, status: int) -> None:
        """Start something, and end it soon by a soft reset. The registers of the device are 0 then."""
        await self.set("control", command)
        await ClockCycles(self.dut.clock, self.random.randrange(100))
        assert await self.get("status") == status
        await self.reset()

    async def reset(self) -> None:
        """A soft reset."""
        await self.set("control", RESET)
        while await self.get("status") != 0:
            pass

    def fail_soon(self, transfers: int) -> None:
        """Two of the next ``transfers`` transfers fail, if so many come."""
        self.memory.fails = {self.memory.transfers + self.random.randrange(transfers) for _ in range(2)}

    async def assert_next_frame_is_right(self) -> None:
        """Whatever happened before."""
        self.memory.fails = set()
        framebuffer, device, content = await self.frame()
        assert (framebuffer, any(device), content == self.expected) == (0, False, True)


@cocotb.test(timeout_time=PATIENCE * PERIOD, timeout_unit="ns")
async def registers_hold_what_fits(dut: Any) -> None:
    """Values are read back, all else is answered with SLVERR; also while reads and writes overlap."""
    shell = Shell(dut, stall=50)
    await shell.begin()
    assert await shell.get("identity") == 0x434C4E44
    absent = ("refit.", "rays.")  # parts that this design does not have
    settings = [
        r
        for r in shell.registers.values()
        if r["access"] == "rw" and not r["name"].startswith(("interrupt", "photo.enabled", *absent))
    ]
    values = {register["name"]: shell.random.getrandbits(register["width"]) for register in settings}
    constants = [shell.get(name) for name in ("identity", "version", "frameSize", "status") * 4]
    accesses = [*constants, *(shell.set(name, value) for name, value in values.items())]
    await Combine(*map(cocotb.start_soon, accesses))
    for register in settings:
        words = range(-(-register["width"] // 32))
        read = [(await shell.read(register["address"] + 4 * word)) for word in words]
        assert all(response == OKAY for _, response in read)
        assert sum(value << 32 * word for word, (value, _) in enumerate(read)) == values[register["name"]]
    for register in settings:
        if register["width"] % 32:
            high = register["address"] + 4 * (register["width"] // 32)
            assert await shell.write(high, 1 << register["width"] % 32) == SLVERR
            assert int((await shell.host.write(high, b"\0")).resp) == SLVERR  # a part of the word
    known = {r["address"] + 4 * word for r in shell.registers.values() for word in range(-(-r["width"] // 32))}
    lacking = [r["address"] for r in shell.registers.values() if r["name"].startswith(absent)]
    for address in (*lacking, *shell.random.sample(sorted(set(range(0, 0x8000, 4)) - known), 20)):
        assert await shell.write(address, 0) == SLVERR
        assert (await shell.read(address))[1] == SLVERR


@cocotb.test(timeout_time=PATIENCE * PERIOD, timeout_unit="ns")
async def frames_are_the_models(dut: Any) -> None:
    """Whatever the memory does; also after a soft reset in a load and in a frame."""
    shell = Shell(dut)
    await shell.begin()
    assert await shell.load() == 0
    await shell.set_frame()
    await shell.assert_next_frame_is_right()
    if shell.has_scene_port:
        assert shell.memory.overtaken > 0
    else:
        for _ in range(2):
            await shell.interrupt(LOAD, IS_LOADING)
            assert await shell.load() == 0
        await shell.set_frame()
    await shell.interrupt(START, IS_RUNNING)
    await shell.set_frame()
    await shell.assert_next_frame_is_right()


@cocotb.test(timeout_time=PATIENCE * PERIOD, timeout_unit="ns")
async def failed_transfers_end_and_the_next_frame_is_right(dut: Any) -> None:
    """Answers with SLVERR and DECERR at random beats."""
    shell = Shell(dut, stall=10, latency=10)
    memory = shell.memory
    await shell.begin()
    assert await shell.load() == 0
    for transfers in [memory.transfers] * shell.job["failedLoads"]:
        shell.fail_soon(transfers)
        assert await shell.load() == RESPONSE
    memory.fails = set()
    assert await shell.load() == 0
    await shell.set_frame()
    before, failed = memory.transfers, memory.failed
    await shell.assert_next_frame_is_right()
    for transfers in [memory.transfers - before] * shell.job["failedFrames"]:
        now = memory.failed
        shell.fail_soon(transfers)
        framebuffer, device, _ = await shell.frame()
        assert (framebuffer == RESPONSE or any(device)) is (memory.failed > now)
        await shell.assert_next_frame_is_right()
    assert memory.failed > failed


@cocotb.test(timeout_time=PATIENCE * PERIOD, timeout_unit="ns")
async def a_flipped_bit_ends_the_frame_and_the_next_is_right(dut: Any) -> None:
    """In the memories of the column's caches, or of the shared cache; a bit of each record of a line."""
    shell = Shell(dut, stall=0, latency=10)
    await shell.begin()
    await shell.set_frame()
    await shell.assert_next_frame_is_right()
    column = dut.device.columns_0
    shared = dut.device.SceneMemory
    for memories, records in (
        ((column.caches_cache.records_ext, column.caches_cache_1.records_ext), 1),
        ((shared.caches_0.lines_ext, shared.caches_1.lines_ext), 2),
    ):
        for memory in memories:
            for line in memory.Memory:
                flip(line, records, shell.random)
        framebuffer, device, _ = await shell.frame()
        assert framebuffer == 0 and any(device)
        await shell.assert_next_frame_is_right()


def flip(line: Any, records: int, choice: random.Random) -> None:
    """Invert a bit of each record of a line, whose parity bit is among them."""
    bits = list(str(line.value))
    size = len(bits) // records
    for first in range(0, len(bits), size):
        at = first + choice.randrange(size)
        bits[at] = {"0": "1", "1": "0"}.get(bits[at], bits[at])
    line.value = LogicArray("".join(bits))
