"""The simulated device for rays (docs/rays.md), as a backend of `colonnade.rays.Scene`."""

from __future__ import annotations

import os
import subprocess
import weakref
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path

from colonnade.common import processes
from colonnade.common.errors import UserError
from colonnade.common.progress import QUIET, Progress
from colonnade.design.config_name import Overrides
from colonnade.design.generator import GeneratedDesign, design_for
from colonnade.design.manifest import Manifest, Register
from colonnade.device.simulator_build import build_simulator
from colonnade.device.verilator import HUGE_PAGES


class RayBackend(ABC):
    """A device that answers the batches of a `Scene`."""

    @abstractmethod
    def load(self, values: Mapping[str, int], records: bytes, count: int) -> None:
        """Load records, and write the registers of a scene and its rays by name."""

    @abstractmethod
    def submit(self, batch: bytes, rays: bytes, size: int) -> tuple[int, bytes]:
        """Run a batch, whose addresses are the device's; its tag, and `size` bytes of its hits."""

    @abstractmethod
    def counters(self) -> dict[str, int]:
        """Sums since the device was made, of cycles too, by the names of the registers."""


class RayDevice(RayBackend):
    """A device of the Verilog, under Verilator.

    Args:
        config: The design, with `queries`.
        overrides: Settings of the design, "key=value".
        options: Options of the simulator, see `rays.cpp`.
        progress: Shows the building of the simulator.
        design: Its Verilog; None: it is generated.
        folder: The simulator's working directory.

    Raises:
        UserError: The design has no `queries`, or a program is missing.
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
        from colonnade import _core

        program, registers = _simulator(design or design_for(config, overrides, progress), progress)
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
            streams = process.stdin, process.stdout, process.stderr
            assert process.stdin is not None
            stack.callback(process.stdin.close)
            self._simulation = _core.RaySimulation(registers, *(each.fileno() for each in streams if each is not None))
            self.close = weakref.finalize(self, stack.pop_all().close)

    def load(self, values: Mapping[str, int], records: bytes, count: int) -> None:
        """See `RayBackend`."""
        self._simulation.load(values, records, count)

    def submit(self, batch: bytes, rays: bytes, size: int) -> tuple[int, bytes]:
        """See `RayBackend`."""
        tag, hits = self._simulation.submit(batch, rays, size)
        return tag, hits

    def counters(self) -> dict[str, int]:
        """See `RayBackend`."""
        sums: dict[str, int] = self._simulation.counters()
        return sums


def device_text(config: str, overrides: Overrides = (), options: Sequence[str] = (), progress: Progress = QUIET) -> str:
    """The content of a file `COLONNADE_RAYS_DEVICE` for the library in C; arguments are as for `RayDevice`.

    Raises:
        UserError: As of `RayDevice`.
    """
    program, registers = _simulator(design_for(config, overrides, progress), progress)
    return "\n".join([f"program {program}", *(f"argument {each}" for each in options), registers])


def require_rays(manifest: Manifest) -> None:
    """Refuse a design that renders.

    Raises:
        UserError: The design has no `queries`.
    """
    if not manifest.has_queries:
        raise UserError("the design traces no rays of applications: choose one with queries, such as traversal")


def registers_text(registers: Mapping[str, Register]) -> str:
    """Registers for the library in C, one a line."""
    lines = (f"register {name} {r.address} {r.width} {int(r.signed)} {r.access}\n" for name, r in registers.items())
    return "".join(lines)


def _simulator(design: GeneratedDesign, progress: Progress) -> tuple[Path, str]:
    """The simulator of a design, and its registers."""
    require_rays(design.manifest)
    return build_simulator(design, progress), registers_text(design.manifest.registers)
