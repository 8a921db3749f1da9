"""A design in its AXI4 shell, behind a memory of any timing: registers by name, and waits that end."""

from __future__ import annotations

from abc import abstractmethod
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np
from colonnade.common.progress import Progress
from colonnade.common.types import Bytes
from colonnade.design.generator import GeneratedDesign
from colonnade.device.shell_simulator import Bus, SimulatedTransport
from colonnade.integration.register_table import WORD, read_shell

from colonnade_lab.evaluation.fuzz.bench import Bench, P, Result

#: Values of `control` and bits of `status`.
LOAD, RESET = 2, 4

#: Cycles after which what has to end hangs.
PATIENCE = 5_000_000

_LATENCIES, _STALLS, _ORDERS = (1, 1, 5, 40, 100), (0, 0, 10, 30, 60, 80), 5


class FuzzedShell:
    """A simulated shell that runs while this object is open.

    Raises:
        RuntimeError: Of any access: something hangs, or the shell breaks a rule of AXI or leaves the memory.
    """

    def __init__(self, design: GeneratedDesign, memory: int, progress: Progress) -> None:
        self.transport = SimulatedTransport(design, memory, progress=progress)
        self.close = self.transport.close
        shell = read_shell(design.dir)
        self._places = {one["name"]: (int(one["address"]), int(one["width"])) for one in shell["registers"]}
        base = int(shell["deviceBase"])
        self._places |= {name: (base + 4 * r.address, r.width) for name, r in design.manifest.registers.items()}
        self.errors = [name for name in design.manifest.registers if name.startswith("errors.")]
        self._interrupts: list[str] = shell["interrupts"]

    def read(self, name: str) -> int:
        """The value of a register."""
        address, width = self._places[name]
        words = [self.transport.read32(address + at) for at in range(0, -(-width // WORD) * 4, 4)]
        return sum(word << 8 * 4 * index for index, word in enumerate(words))

    def write(self, values: Mapping[str, int]) -> None:
        """Set registers."""
        for name, value in values.items():
            address, width = self._places[name]
            bits = value & ((1 << width) - 1)
            for word in range(-(-width // WORD)):
                self.transport.write32(address + 4 * word, bits >> WORD * word & 0xFFFFFFFF)

    def until_zero(self, name: str) -> None:
        """Run until a register is 0."""
        cycles, total = 20, 0
        while self.read(name):
            if total > PATIENCE:
                raise RuntimeError(f"{name} is {self.read(name)} after {total:,} cycles")
            total += self.transport.run(cycles)
            cycles = min(2 * cycles, 20_000)

    def events(self) -> set[str]:
        """The events of `interrupt.status`, which are cleared."""
        bits = self.read("interrupt.status")
        self.write({"interrupt.status": bits})
        return {name for bit, name in enumerate(self._interrupts) if bits >> bit & 1}

    def load(self, base: int, content: bytes) -> None:
        """Load a device image."""
        self.transport.store(base, content)
        image = {"base": base, "windowBase": base, "windowEnd": base + len(content), "bytes": len(content)}
        self.write({**{f"image.{name}": value for name, value in image.items()}, "control": LOAD})
        self.until_zero("status")
        if errors := self.read("image.errors"):
            raise RuntimeError(f"image.errors is {errors} after a legal load")

    def reset(self) -> None:
        """A soft reset."""
        self.write({"control": RESET})
        self.until_zero("status")

    def content(self) -> Bytes:
        """The whole memory."""
        return np.frombuffer(self.transport.fetch(0, self.transport.size), np.uint8)


class ShellBench(Bench[P]):
    """Cases that run one after the other on a shell, which is opened again after one at which it hangs or stops.

    Attributes:
        memory: Bytes of the memory.
    """

    memory: ClassVar[int]

    def __init__(self, design: GeneratedDesign, progress: Progress) -> None:
        self.manifest = design.manifest
        self._design, self._progress = design, progress
        self._sums = Counter[str]()

    @abstractmethod
    def _set_up(self, shell: FuzzedShell) -> None:
        """What a shell needs before its first case."""

    @abstractmethod
    def _run(self, shell: FuzzedShell, plan: P) -> Result:
        """Run a case, and the legal work after it."""

    def run(self, planned: Sequence[P]) -> list[Result]:
        """See `Bench`."""
        results: list[Result] = []
        shell: FuzzedShell | None = None
        for plan in planned:
            try:
                if shell is None:
                    shell = FuzzedShell(self._design, self.memory, self._progress)
                    self._set_up(shell)
                results.append(self._run(shell, plan))
            except RuntimeError as error:
                results.append(Result.of("", (str(error),), ()))
                if shell is not None:
                    shell.close()
                shell = None
        if shell is not None:
            shell.close()
        return results


def any_bus(random: np.random.Generator, errors: int = 0) -> Bus:
    """A memory of any timing."""
    latency, stall = (choices[int(random.integers(len(choices)))] for choices in (_LATENCIES, _STALLS))
    return Bus(latency, stall, int(random.integers(_ORDERS)), int(random.integers(1, 1 << 31)), errors)


def differing(after: Bytes, expected: Bytes, opened: np.ndarray, what: str) -> list[str]:
    """A description of the bytes that differ from the expected ones, where not opened (bool)."""
    places = np.flatnonzero((after != expected) & ~opened)
    return [f"{len(places)} bytes of {what} differ, the first one at {places[0]:#x}"] if len(places) else []
