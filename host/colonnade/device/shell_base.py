"""A device in its AXI4 shell, whatever it computes: the driver in C (driver/src) over a transport."""

from __future__ import annotations

import time
from contextlib import ExitStack
from typing import Any

from typing_extensions import Self

from colonnade.common.arguments import checked
from colonnade.common.errors import UserError
from colonnade.common.progress import QUIET, Progress
from colonnade.design.config_name import Overrides
from colonnade.design.generator import GeneratedDesign, shell_design_for, shell_manifest_for
from colonnade.device.shell_simulator import SimulatedTransport
from colonnade.device.transport import LitexClient, LitexTransport, PacedTransport, Transport, UioTransport
from colonnade.integration.driver_design import DriverDesign
from colonnade.integration.register_table import register_table
from colonnade.scene_image.device_image import device_image
from colonnade.scene_image.dram_image import PAGE_BYTES, dram_image
from colonnade.scene_image.file import Loads

#: Events: bits of ``interrupt.status``. A device for rays has batches in place of frames.
FRAME_DONE, IMAGE_DONE, ERROR = 1, 2, 4
#: What the errors of the driver mean here (docs/driver.md).
_MEANINGS = {
    "noDevice": "no Colonnade answers: check the address, and that the design is loaded",
    "unknownVersion": "the shell has another version: use the host of its release",
    "otherFormat": "the device has another design: give its configuration",
    "tooLarge": "a transfer left the memory of the device",
    "busy": "the device is busy: wait for its frame, or reset it",
    "busResponse": "the memory has answered the device with an error",
    "misaligned": "the address of the framebuffer is not aligned: give a multiple of 4096",
    "noFrame": "no frame is set: set its registers before the start",
    "noRays": "the design traces no rays of applications: choose one with queries, such as traversal",
    "noPhoto": "the device composites no photo, or not the strengths of its shadows: render without them",
}


class Shell:
    """A device in its AXI4 shell, simulated or on a board.

    Args:
        transport: The way to it; closed if this fails.
        design: Its design with the shell: `shell_manifest_for`, or a folder of ``colonnade generate --axi``.

    Raises:
        UserError: There is no device, or one of another design.
    """

    def __init__(self, transport: Transport, design: GeneratedDesign) -> None:
        from colonnade import _core

        self.transport = transport
        with ExitStack() as on_error:
            on_error.callback(transport.close)
            self._table = register_table(design)
            self.manifest = design.manifest
            self._design = DriverDesign.of(self._table, design.manifest)
            self._paced = PacedTransport(transport)
            self._driver: Any = _core.Driver(
                self._paced, list(self._design.format_words), dict(self._design.numbers), list(self._design.maps)
            )
            self._check(self._driver.probe())
            self._driver.enable_interrupts(FRAME_DONE | IMAGE_DONE)
            on_error.pop_all()

    @classmethod
    @checked
    def simulated(
        cls, config: str = "small", overrides: Overrides = (), *, memory: int = 1 << 26, progress: Progress = QUIET
    ) -> Self:
        """The RTL under Verilator, with a memory behind its bus.

        Args:
            config: As in `ModelDevice`.
            overrides: As in `ModelDevice`.
            memory: Bytes of the memory.
            progress: Shows the steps. The first use of a design compiles its simulator, in a minute or more.

        Raises:
            UserError: There is no such configuration, or no Java or Verilator.
        """
        if not PAGE_BYTES <= memory <= 1 << 32:
            raise UserError(f"memory is {memory}: it must be from {PAGE_BYTES:,} to {1 << 32:,} bytes")
        design = shell_design_for(config, overrides, progress=progress)
        return cls(SimulatedTransport(design, memory, progress=progress), design)

    @classmethod
    @checked
    def uio(cls, path: str = "/dev/uio0", config: str = "small", overrides: Overrides = ()) -> Self:
        """A device on the bus of this machine, by Linux' UIO (`UioTransport`): until `close`, the console does not draw
        where a display shows the device's memory.

        Args:
            path: The UIO device.
            config: As in `ModelDevice`: the design in the chip.
            overrides: As in `ModelDevice`.

        Raises:
            UserError: There is no device, or one of another design.
        """
        design = shell_manifest_for(config, overrides)
        return cls(UioTransport(path), design)

    @classmethod
    @checked
    def litex(
        cls,
        client: LitexClient,
        registers: int,
        memory: tuple[int, int],
        config: str = "small",
        overrides: Overrides = (),
    ) -> Self:
        """A device in a LiteX SoC, through LiteX's ``RemoteClient`` (`LitexTransport`).

        Args:
            client: ``RemoteClient()``, open.
            registers: Bus address of the device's registers.
            memory: Bus address and bytes of memory that the SoC's software does not use.
            config: As in `ModelDevice`: the design in the SoC.
            overrides: As in `ModelDevice`.

        Raises:
            UserError: There is no device, or one of another design.
        """
        return cls(LitexTransport(client, registers, *memory), shell_manifest_for(config, overrides))

    def _begin(self, timeout: float | None) -> None:
        self._paced.deadline = time.monotonic() + (self.transport.patience if timeout is None else timeout)

    def _check(self, error: str) -> None:
        if error != "ok":
            raise UserError(f"{_MEANINGS.get(error, 'the driver has refused the call')} ({error})")

    def _loaded(self, image: Loads) -> int:
        """Load records and maps, or store the ones that lie in DRAM; the address of the first page behind them."""
        base, content = self.transport.base, device_image(image, self.manifest)
        free = self._stored("the scene", base, content)
        self._begin(None)
        self._check(self._driver.load(content, base, self._window(base, len(content)), False))
        if self._design.numbers["scene_page"]:
            address, free = free, self._stored("the scene", free, dram_image(image, self.manifest))
            self._check(self._driver.set_scene(address))
        return free

    def _window(self, base: int, size: int) -> tuple[int, int]:
        return base, base + size

    def _stored(self, what: str, address: int, content: bytes) -> int:
        """Store bytes; the address of the first page behind them."""
        self._require_memory(what, address, len(content))
        self.transport.store(address, content)
        return address + -(-len(content) // PAGE_BYTES) * PAGE_BYTES

    def _require_memory(self, what: str, address: int, size: int) -> None:
        if address < self.transport.base:
            raise UserError(
                f"{what} at {address:#x} is below the device's memory, which is at {self.transport.base:#x}"
            )
        beyond = address + size - self.transport.base - self.transport.size
        if beyond > 0:
            raise UserError(
                f"the device's memory of {self.transport.size:,} bytes is too small for {what}:"
                f" {beyond:,} more are needed"
            )
