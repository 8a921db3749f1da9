"""Tests of the pixel stream that run in the simulator; test_cocotb.py starts them."""

from __future__ import annotations

from typing import Any

import cocotb
from axi_memory import UNWRITTEN, stalls
from axi_rules import Channel
from cocotb.triggers import ClockCycles, RisingEdge
from shell_bench import IS_RUNNING, PATIENCE, PERIOD, START, Shell

STALL = 80  # percent
XRGB_BYTES = 4


class Sink:
    """Takes beats, and watches that they hold until then.

    Attributes:
        packets: The beats of each packet, as fields in strings of bits; the last one has not ended.
    """

    def __init__(self, dut: Any, seed: int) -> None:
        self.packets: list[list[dict[str, str]]] = [[]]
        cocotb.start_soon(self._take(dut, seed))

    async def _take(self, dut: Any, seed: int) -> None:
        channel = Channel(dut, "m_axis", "t", ("data", "keep", "last", "user"))
        for pauses in stalls(STALL, seed):
            dut.m_axis_tready.value = int(not pauses)
            await RisingEdge(dut.clock)
            beat = channel.sample() if str(dut.reset.value) == "0" else None
            if beat is not None:
                self.packets[-1].append(beat)
                if beat["last"] == "1":
                    self.packets.append([])

    def framebuffer(self, stride: int, size: int) -> bytes:
        """All packets as a framebuffer; no byte comes twice."""
        content, seen = bytearray([UNWRITTEN]) * size, set()
        assert self.packets.pop() == []
        for packet in self.packets:
            (user,) = {int(beat["user"], 2) for beat in packet}
            lanes = len(packet[0]["keep"])
            first = (user >> 16) * stride + XRGB_BYTES * (user & 0xFFFF)
            for number, beat in enumerate(packet):
                for lane, keeps in enumerate(reversed(beat["keep"])):
                    if keeps == "1":
                        place, end = first + lanes * number + lane, len(beat["data"]) - 8 * lane
                        assert place not in seen
                        seen.add(place)
                        content[place] = int(beat["data"][end - 8 : end], 2)
        self.packets = [[]]
        return bytes(content)


@cocotb.test(timeout_time=PATIENCE * PERIOD, timeout_unit="ns")
async def streamed_pixels_are_the_models(dut: Any) -> None:
    """Whatever the sink does, and none is written to memory; also after a soft reset in a frame."""
    shell = Shell(dut)
    sink = Sink(dut, shell.random.getrandbits(32))
    await shell.begin()
    assert await shell.load() == 0
    for _ in range(2):
        await shell.set_frame()
        await shell.set("stream.enabled", 1)
        framebuffer, device, content = await shell.frame()
        assert (framebuffer, any(device), set(content)) == (0, False, {UNWRITTEN})
        assert sink.framebuffer(shell.job["stride"], len(content)) == shell.expected
        await shell.set("control", START)
        while not any(sink.packets):
            await ClockCycles(dut.clock, 1)
        assert await shell.get("status") == IS_RUNNING
        await shell.reset()
        assert sink.packets.pop() == []  # every packet has ended
        sink.packets = [[]]
    await shell.set_frame()
    await shell.set("stream.enabled", 0)
    await shell.assert_next_frame_is_right()
