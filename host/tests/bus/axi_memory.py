"""A memory behind the AXI4 ports, on the channels of cocotbext-axi: random latencies, orders, stalls and errors."""

from __future__ import annotations

import itertools
import random
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import cocotb
from cocotb.triggers import ClockCycles, RisingEdge
from cocotbext.axi import AxiBus, AxiReadBus
from cocotbext.axi.axi_channels import AxiARSink, AxiAWSink, AxiBSource, AxiRSource, AxiWSink

UNWRITTEN = 0xA5
OKAY, SLVERR, DECERR = 0, 2, 3
#: When the address and the data of a write are taken; AXI4 allows all of these.
WRITE_ORDERS = ("any", "data first", "address first")


def stalls(percent: int, seed: int) -> Iterator[bool]:
    """Whether a channel pauses, cycle by cycle."""
    choice = random.Random(seed)
    return (choice.randrange(100) < percent for _ in itertools.count())


@dataclass
class Read:
    """Beats that are to be sent, not before the cycle ``due``."""

    identifier: int
    due: int
    beats: list[dict[str, int]] = field(default_factory=list)


class AxiMemory:
    """Reads of one id are answered in order, reads of different ids in any order, beat by beat.

    Attributes:
        bytes: The content, from address 0.
        latency: Most cycles from an address, or from the last data of a write, to the answer.
        transfers: Beats of reads, and writes, that have been answered.
        fails: Those of them that are answered with SLVERR or DECERR, by number; no data move then.
        failed: Number of these errors.
        overtaken: Beats of a read that were sent while an older one of another id waited.
    """

    def __init__(self, dut: Any, size: int, stall: int, latency: int, seed: int) -> None:
        self.bytes = bytearray([UNWRITTEN]) * size
        self.latency = latency
        self.fails: set[int] = set()
        self.transfers = self.failed = self.overtaken = 0
        self._dut, self._stall = dut, stall
        self._random = random.Random(seed)
        self._order = WRITE_ORDERS[seed % len(WRITE_ORDERS)]
        self._is_writing = False
        bus = AxiBus.from_prefix(dut, "m_axi")
        cocotb.start_soon(
            self._write(*self._channels((AxiAWSink, bus.write.aw), (AxiWSink, bus.write.w), (AxiBSource, bus.write.b)))
        )
        ports = [bus.read]
        if hasattr(dut, "m_axi_scene_arvalid"):
            ports.append(AxiReadBus.from_prefix(dut, "m_axi_scene"))
        for port in ports:
            channels = self._channels((AxiARSink, port.ar), (AxiRSource, port.r))
            port.r.rid.value = 0  # rready depends on it, also while rvalid is low
            cocotb.start_soon(self._read(*channels))

    def _channels(self, *kinds: tuple[Any, Any]) -> list[Any]:
        channels = [kind(bus, self._dut.clock, self._dut.reset) for kind, bus in kinds]
        for channel in channels:
            channel.set_pause_generator(stalls(self._stall, self._random.getrandbits(32)))
        return channels

    def _answer(self) -> int:
        self.transfers += 1
        if self.transfers - 1 not in self.fails:
            return OKAY
        self.failed += 1
        return self._random.choice((SLVERR, DECERR))

    async def _reorder(self, addresses: Any, data: Any) -> None:
        """Take addresses only when data wait, data only when an address waits, or both at any time."""
        if self._order == "any":
            return
        waiting = addresses if self._order == "data first" else data
        waiting.clear_pause_generator()
        while True:
            await RisingEdge(self._dut.clock)
            has_other = not data.empty() if waiting is addresses else self._is_writing or not addresses.empty()
            waiting.pause = not has_other

    async def _write(self, addresses: Any, data: Any, answers: Any) -> None:
        cocotb.start_soon(self._reorder(addresses, data))
        while True:
            self._is_writing = False
            burst = await addresses.recv()
            self._is_writing = True
            lanes = len(data.bus.wstrb)
            response = self._answer()
            for beat in range(int(burst.awlen) + 1):
                word = await data.recv()
                first = (int(burst.awaddr) // lanes + beat) * lanes
                bits, strobes = str(word.wdata), str(word.wstrb)[::-1]
                for lane in range(lanes if response == OKAY else 0):
                    if strobes[lane] == "1":
                        end = len(bits) - 8 * lane
                        self.bytes[first + lane] = int(bits[end - 8 : end], 2)
            cocotb.start_soon(self._respond(answers, int(burst.awid), response))

    async def _respond(self, answers: Any, identifier: int, response: int) -> None:
        await ClockCycles(self._dut.clock, 1 + self._random.randrange(self.latency))
        await answers.send(answers._transaction_obj(bid=identifier, bresp=response))

    async def _read(self, addresses: Any, data: Any) -> None:
        reads: list[Read] = []
        data.queue_occupancy_limit = 1
        for cycle in itertools.count():
            await RisingEdge(self._dut.clock)
            while not addresses.empty():
                reads.append(self._taken(addresses.recv_nowait(), len(data.bus.rdata) // 8, cycle))
            oldest = {read.identifier: read for read in reversed(reads)}.values()  # of each id
            due = [read for read in oldest if read.due <= cycle]
            if not due or data.full():
                continue
            read = self._random.choice(due)
            self.overtaken += read is not reads[0]
            data.send_nowait(data._transaction_obj(**read.beats.pop(0)))
            if not read.beats:
                reads.remove(read)

    def _taken(self, burst: Any, lanes: int, cycle: int) -> Read:
        identifier, count = int(burst.arid), int(burst.arlen) + 1
        read = Read(identifier, cycle + self._random.randrange(self.latency))
        first = int(burst.araddr) // lanes * lanes
        for place in range(first, first + count * lanes, lanes):
            response = self._answer()
            content = int.from_bytes(self.bytes[place : place + lanes], "little") if response == OKAY else 0
            is_last = len(read.beats) + 1 == count
            read.beats.append({"rid": identifier, "rdata": content, "rresp": response, "rlast": is_last})
        return read
