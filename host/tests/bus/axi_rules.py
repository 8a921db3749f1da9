"""Watches an AXI port of the design under test in every cycle: rules that cocotbext-axi does not check."""

from __future__ import annotations

from collections import deque
from typing import Any

import cocotb
from cocotb.triggers import RisingEdge


class Channel:
    """What is offered holds until it is taken, and has no unknown bit.

    Bytes without their bit of ``strb`` or ``keep`` and the data of failed reads are not looked at.
    """

    def __init__(self, dut: Any, port: str, name: str, fields: tuple[str, ...]) -> None:
        self.name = f"{port}_{name}"
        self.valid, self.ready = (getattr(dut, f"{self.name}{signal}") for signal in ("valid", "ready"))
        self.fields = {field: getattr(dut, f"{self.name}{field}") for field in fields}
        self.offered: dict[str, str] | None = None

    def sample(self) -> dict[str, str] | None:
        """The transfer of this cycle: its fields as strings of bits; None if there is none."""
        valid = str(self.valid.value)
        assert valid in "01", f"{self.name}valid is {valid}"
        if valid == "0":
            assert self.offered is None, f"{self.name}valid falls before {self.name}ready"
            return None
        now = {field: str(signal.value) for field, signal in self.fields.items()}
        if self.offered is None:
            self._check_known(now)
        else:
            assert now == self.offered, f"{self.name} changes before it is taken: {self.offered} to {now}"
        taken = str(self.ready.value) == "1"
        self.offered = None if taken else now
        return now if taken else None

    def _check_known(self, now: dict[str, str]) -> None:
        for field, bits in now.items():
            strobes = now.get("strb", now.get("keep"))
            if field == "data" and strobes is not None:
                lanes = [bits[8 * i : 8 * i + 8] for i, strobe in enumerate(strobes) if strobe != "0"]
                bits = "".join(lanes)
            elif field == "data" and now["resp"] != "00":
                continue
            assert set(bits) <= {"0", "1"}, f"{self.name}{field} is {bits}"


#: Fields of the channels that a master drives, and of the slave's.
MASTER = {"aw": ("addr", "id", "len", "size", "burst", "prot"), "w": ("data", "strb", "last")}
MASTER["ar"] = MASTER["aw"]
SLAVE_LITE = {"b": ("resp",), "r": ("data", "resp")}


async def watch_master(dut: Any, port: str, channels: str, windows: list[range]) -> None:
    """Watch the channels that a master drives; ``windows`` are the addresses that it may read or write.

    Args:
        dut: The design.
        port: Prefix of the pins.
        channels: Names of channels, separated by spaces.
        windows: All transfers lie in one of these ranges of byte addresses; a list that may change meanwhile.
    """
    watched = {name: Channel(dut, port, name, MASTER[name]) for name in channels.split()}
    beats: deque[int] = deque()  # of the writes whose address has been offered, and whose data are to follow
    while True:
        await RisingEdge(dut.clock)
        if str(dut.reset.value) != "0":
            continue
        for name, channel in watched.items():
            was_offered = channel.offered is not None
            taken = channel.sample()
            if name == "aw" and not was_offered and (offered := taken or channel.offered) is not None:
                beats.append(int(offered["len"], 2) + 1)
            if name == "w" and (taken or channel.offered) is not None:
                assert beats, "data are offered before their address"
            if taken is None:
                continue
            if name == "w":
                beats[0] -= 1
                assert taken["last"] == str(int(beats[0] == 0)), f"wlast is {taken['last']}, {beats[0]} beats to come"
                if beats[0] == 0:
                    beats.popleft()
                continue
            address, size, count = (int(taken[field], 2) for field in ("addr", "size", "len"))
            end = address + (count + 1 << size)
            assert taken["burst"] == "01" and taken["prot"] == "010" and address // 4096 == (end - 1) // 4096, (
                f"an illegal burst: {taken}"
            )
            assert any(window.start <= address and end <= window.stop for window in windows), f"outside: {taken}"


async def watch_slave(dut: Any, port: str) -> None:
    """Watch the answers of an AXI4-Lite slave."""
    watched = [Channel(dut, port, name, fields) for name, fields in SLAVE_LITE.items()]
    while True:
        await RisingEdge(dut.clock)
        if str(dut.reset.value) == "0":
            for channel in watched:
                channel.sample()


def watch(dut: Any, windows: list[range], has_scene: bool) -> list[cocotb.Task[None]]:
    """Watch all ports of ColonnadeAxi until the test ends; a broken rule fails it."""
    tasks = [watch_slave(dut, "s_axil"), watch_master(dut, "m_axi", "aw w ar", windows)]
    if has_scene:
        tasks.append(watch_master(dut, "m_axi_scene", "ar", windows))
    return [cocotb.start_soon(task) for task in tasks]
