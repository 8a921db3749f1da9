"""cocotb: registers of the shell through the AXI4 slave of ``examples/axi4``."""

from __future__ import annotations

import random
from typing import Any

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import ClockCycles
from cocotbext.axi import AxiBus, AxiMaster, AxiResp

IDENTITY, VERSION, BASE = 0x00, 0x04, 0x80
REGION = 0x9000_0000


@cocotb.test()
async def registers_through_axi4(dut: Any) -> None:
    """Words in both halves of a beat; what the registers cannot do is refused, and leaves them as they are."""
    cocotb.start_soon(Clock(dut.clock, 10, "ns").start())
    for name in ("awready", "wready", "bvalid", "arready", "rvalid"):
        getattr(dut, f"m_axi_{name}").value = 0
    master = AxiMaster(AxiBus.from_prefix(dut, "s_axi"), dut.clock, dut.reset)
    dut.reset.value = 1
    await ClockCycles(dut.clock, 10)
    dut.reset.value = 0

    async def read(address: int, size: int = 2) -> bytes:
        answer = await master.read(REGION + address, 1 << size, size=size)
        assert answer.resp == AxiResp.OKAY
        return bytes(answer.data)

    assert await read(IDENTITY) == b"DNLC"
    assert (await read(VERSION))[2:] == b"\x01\x00"
    values = random.Random(1).randbytes(5) + bytes(3)  # an address of 40 bits
    for place in (0, 4):
        written = await master.write(REGION + BASE + place, values[place : place + 4], size=2)
        assert written.resp == AxiResp.OKAY
    words = [await read(BASE + place) for place in (0, 4)]
    assert b"".join(words) == values
    for length, size in ((8, 3), (16, 3), (8, 2)):
        assert (await master.read(REGION + BASE, length, size=size)).resp == AxiResp.SLVERR
        assert (await master.write(REGION + BASE, bytes(length), size=size)).resp == AxiResp.SLVERR
    assert [await read(BASE + place) for place in (0, 4)] == words
