"""The simulated device for rays (docs/rays.md), as a backend of `colonnade.rays.Scene`."""

from __future__ import annotations

import io
import os
import subprocess
import weakref
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path

from colonnade.common import processes
from colonnade.common.errors import UserError
from colonnade.common.progress import QUIET, Progress
from colonnade.design.config_name import Overrides
from colonnade.design.generator import GeneratedDesign, design_for
from colonnade.design.manifest import Register
from colonnade.device.simulator_build import build_simulator
from colonnade.device.verilator import HUGE_PAGES

#: Where the simulator has rays, hits and the tag of a batch.
_RAYS, _HITS, _TAG = 1 << 32, 2 << 32, 64


class RayBackend(ABC):
    """A device that answers the batches of a `Scene`.

    Args:
        registers: Those of its design.
    """

    def __init__(self, registers: Mapping[str, Register]) -> None:
        self._registers = registers
        self._before: dict[str, int] = {}

    @abstractmethod
    def load(self, values: Mapping[str, int], records: bytes, count: int) -> None:
        """Load records, and write the registers of a scene and its rays by name."""

    @abstractmethod
    def submit(self, batch: bytes, rays: bytes, size: int) -> tuple[int, bytes]:
        """Run a batch, whose addresses are the device's; its tag, and `size` bytes of its hits."""

    def counters(self) -> dict[str, int]:
        """Sums since the device was made, of cycles too, by the names of the registers."""
        sums = {}
        for name, register in self._registers.items():
            kind, _, counter = name.partition(".")
            if kind == "counters":
                value = register.decode([self._word(register.address + word) for word in range(register.words)])
                before = self._before.get(counter, 0)
                sums[counter] = max(value, before) if counter == "deepestStack" else value + before
        return sums

    @abstractmethod
    def _word(self, address: int) -> int: ...


class RayDevice(RayBackend):
    """A device of the Verilog, under Verilator.

    Args:
        config: The design, with frame.rays.
        overrides: Settings of the design, "key=value".
        options: Options of the simulator, see `rays.cpp`.
        progress: Shows the building of the simulator.
        design: Its Verilog; None: it is generated.
        folder: The simulator's working directory.

    Raises:
        UserError: The design has no frame.rays, or a program is missing.
        RuntimeError: Of any call: the simulated hardware failed.
    """

    def __init__(
        self,
        config: str,
        overrides: Overrides = (),
        options: Sequence[str] = (),
        progress: Progress = QUIET,
        design: GeneratedDesign | None = None,
        folder: Path | None = None,
    ) -> None:
        design = design or design_for(config, overrides, progress)
        if not design.manifest.config["frame"]["rays"]:
            raise UserError("the design traces no rays of applications: choose one with frame.rays, such as traversal")
        super().__init__(design.manifest.registers)
        program = build_simulator(design, progress)
        with ExitStack() as stack:
            process = stack.enter_context(
                processes.started(
                    [program, *options],
                    cwd=folder,
                    env=os.environ | HUGE_PAGES,
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    stderr=subprocess.PIPE,
                )
            )
            assert isinstance(process.stdin, io.TextIOWrapper) and isinstance(process.stdout, io.TextIOWrapper)
            stack.callback(process.stdin.close)
            self._commands, self._answers, self._errors = process.stdin.buffer, process.stdout.buffer, process.stderr
            self.close = weakref.finalize(self, stack.pop_all().close)

    def load(self, values: Mapping[str, int], records: bytes, count: int) -> None:
        """See `RayBackend`."""
        self._before = self.counters()
        self._send(f"load {count} {len(records) // count}", records)
        written = dict.fromkeys((name for name, each in self._registers.items() if each.access == "rw"), 0)
        commands = {name: 1 for name in ("control.invalidate", "control.start") if name in self._registers}
        for name, value in {**written, **values, **commands}.items():
            for address, word in self._registers[name].encode(value):
                self._send(f"write {address} {word}")

    def submit(self, batch: bytes, rays: bytes, size: int) -> tuple[int, bytes]:
        """See `RayBackend`."""
        words = [(_RAYS, 0), (_HITS, 8), (_TAG, 48)]
        for address, at in words:
            batch = batch[:at] + address.to_bytes(8, "little") + batch[at + 8 :]
        self._send(f"batch {self._registers['rays.tail'].address} {len(rays)} {size}", batch + rays)
        tag = int(self._line())
        return tag, self._answers.read(size)

    def _word(self, address: int) -> int:
        self._send(f"read {address}")
        return int(self._line())

    def _send(self, command: str, data: bytes = b"") -> None:
        try:
            self._commands.write(f"{command}\n".encode() + data)
        except (BrokenPipeError, ValueError):
            self._fail()

    def _line(self) -> bytes:
        with suppress(BrokenPipeError):
            self._commands.flush()
        return self._answers.readline() or self._fail()

    def _fail(self) -> bytes:
        assert self._errors is not None
        raise RuntimeError(f"the simulated hardware failed: {self._errors.read().strip()}")
