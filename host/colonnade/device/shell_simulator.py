"""The AXI4 shell in the simulator, with a memory behind its bus: a transport of `ShellDevice`."""

from __future__ import annotations

import io
import math
import os
import subprocess
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

from colonnade.common import processes
from colonnade.common.progress import QUIET, Progress
from colonnade.common.temporary import temporary_folder
from colonnade.design.generator import GeneratedDesign
from colonnade.device.shell_build import build_shell_simulator
from colonnade.device.verilator import HUGE_PAGES
from colonnade.integration.register_table import read_shell

_FILE = "block"


@dataclass(frozen=True)
class Bus:
    """The memory behind the shell.

    Attributes:
        latency: Cycles from a read or the end of a write to its answer.
        stall: Percentage of cycles in which a channel does not move, 0 to 99.
        order: When the address and the data of a write are taken, a number of `WriteOrder` of the testbench, 0 to 4.
        seed: Random seed of the stalls, and of the registers' values at power-up.
        errors: So many of 1024 answers to the masters are errors, after `SimulatedTransport.set_bus`.
    """

    latency: int = 1
    stall: int = 0
    order: int = 0
    seed: int = 1
    errors: int = 0


@dataclass(frozen=True)
class SharedMemory:
    """A file that is the memory behind the shell, and that other programs also map.

    Attributes:
        path: It has the memory's size, or more.
        base: Bus address of its first byte, a multiple of 4096 below 2^32.
    """

    path: Path
    base: int


class SimulatedTransport:
    """A Verilated shell that runs while this object is open; its clock stands still between accesses.

    Args:
        design: A design with its shell (`generator.shell_design_for`).
        size: Bytes of the memory.
        bus: The memory's timing.
        progress: Shows the building of the simulator.
        shared: The memory; without it, one from bus address 0, in which bytes that nobody has written are 0xA5.

    Raises:
        RuntimeError: Of any access: the shell breaks a rule of AXI, refuses an access, or leaves the memory.
    """

    #: Cycles after which a wait returns without an interrupt.
    SLICE = 1_000_000

    def __init__(
        self,
        design: GeneratedDesign,
        size: int = 1 << 26,
        bus: Bus = Bus(),
        progress: Progress = QUIET,
        shared: SharedMemory | None = None,
    ) -> None:
        self.base, self.size, self.patience = 0 if shared is None else shared.base, size, math.inf
        options = {"bus": read_shell(design.dir)["busBytes"], "memory": size, "latency": bus.latency}
        options |= {"stall": bus.stall, "order": bus.order, "seed": bus.seed}
        arguments = [text for name, value in options.items() for text in (f"--{name}", str(value))]
        if shared is not None:
            arguments += ["--base", str(shared.base), "--shared", str(shared.path.resolve())]
        program = build_shell_simulator(design, progress)
        with ExitStack() as stack:
            self._folder = stack.enter_context(temporary_folder())
            self._program = stack.enter_context(
                processes.started(
                    [program, *arguments, "-"],
                    cwd=self._folder,
                    env=os.environ | HUGE_PAGES,
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    stderr=subprocess.PIPE,
                )
            )
            self._stack = stack.pop_all()
        assert isinstance(self._program.stdin, io.TextIOWrapper) and self._program.stdout is not None
        self._commands, self._answers = self._program.stdin, self._program.stdout

    def read32(self, address: int) -> int:
        """See `Transport`."""
        return int(self._ask(f"read x {address} 1")[-1])

    def write32(self, address: int, value: int) -> None:
        """See `Transport`."""
        self._send(f"write {address} {value}")

    def wait(self) -> int:
        """Run to the next interrupt that is enabled, a million cycles at most; the number of cycles."""
        return self.run(self.SLICE)

    def run(self, cycles: int) -> int:
        """Run so many cycles, or to the next interrupt that is enabled; the number of cycles."""
        return int(self._ask(f"run {cycles}")[-1])

    def store(self, address: int, data: bytes) -> None:
        """See `Transport`."""
        (self._folder / _FILE).write_bytes(data)
        self._send(f"store {_FILE} {address}")
        self.read32(0)  # it has read the file

    def fetch(self, address: int, size: int) -> bytes:
        """See `Transport`."""
        self._send(f"dump {_FILE} {address} {size}")
        self.read32(0)  # it has written the file
        return (self._folder / _FILE).read_bytes()

    def set_bus(self, bus: Bus) -> None:
        """Set the memory behind the masters from now on; a scene's memory in DRAM stays as it is."""
        self._send(f"bus {bus.latency} {bus.stall} {bus.order} {bus.errors} {bus.seed}")

    def fail(self, beats: int) -> None:
        """Answer so many of 1024 beats of the scene's reads with an error, in a design with a scene in DRAM."""
        self._send(f"fail {beats}")

    def close(self) -> None:
        """End the simulator."""
        self._commands.close()
        self._stack.close()

    def _send(self, command: str) -> None:
        try:
            self._commands.write(f"{command}\n")
        except (BrokenPipeError, ValueError):
            self._fail()

    def _ask(self, command: str) -> list[str]:
        self._send(command)
        try:
            self._commands.flush()
        except BrokenPipeError:
            self._fail()
        words = self._answers.readline().split()
        if not words:
            self._fail()
        return words

    def _fail(self) -> NoReturn:
        if self._commands.closed:
            raise RuntimeError("the simulated device is closed")
        assert self._program.stderr is not None
        raise RuntimeError(f"the simulated hardware failed: {self._program.stderr.read().strip()}")
