"""A device in its AXI4 shell: the driver in C (driver/src/colonnade.c) over a transport."""

from __future__ import annotations

import time
from collections.abc import Mapping
from contextlib import ExitStack
from typing import Any

import numpy as np

from colonnade.common.arguments import checked
from colonnade.common.errors import UserError
from colonnade.common.framebuffer_formats import FORMATS, PIXEL_BYTES, photo_lines
from colonnade.common.progress import QUIET, Progress
from colonnade.design.config_name import Overrides
from colonnade.design.generator import GeneratedDesign, shell_design_for, shell_manifest_for
from colonnade.device.device import Device, Pixels, check_frame, exclusive, require_format, require_no_errors, rgb_of
from colonnade.device.shell_simulator import SimulatedTransport
from colonnade.device.transport import LitexClient, LitexTransport, PacedTransport, Transport, UioTransport
from colonnade.integration.driver_design import DriverDesign
from colonnade.integration.register_table import register_table
from colonnade.registers.frame_file import frame_file
from colonnade.scene_image.device_image import device_image
from colonnade.scene_image.dram_image import PAGE_BYTES, dram_image
from colonnade.scene_image.file import SceneImage

#: Events: bits of ``interrupt.status``.
_FRAME_DONE, _IMAGE_DONE, _ERROR = 1, 2, 4
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
    "noPhoto": "the device composites no photo, or not the strengths of its shadows: render without them",
}


class ShellDevice(Device):
    """A device in its AXI4 shell, simulated or on a board.

    The image lies at the beginning of the memory; behind it are the records of a scene in DRAM, the photo, and the
    framebuffer.

    Args:
        transport: The way to it; closed with the device, and if this fails.
        design: Its design with the shell: `shell_manifest_for`, or a folder of ``colonnade generate --axi``.

    Raises:
        UserError: There is no device, or one of another design.
    """

    @checked
    def __init__(self, transport: Transport, design: GeneratedDesign) -> None:
        from colonnade import _core

        super().__init__(design.manifest)
        self.transport = transport
        with ExitStack() as on_error:
            on_error.callback(transport.close)
            self._table = register_table(design)
            self._design = DriverDesign.of(self._table, design.manifest)
            self._paced = PacedTransport(transport)
            self._driver: Any = _core.Driver(
                self._paced, list(self._design.format_words), dict(self._design.numbers), list(self._design.maps)
            )
            self._check(self._driver.probe())
            self._driver.enable_interrupts(_FRAME_DONE | _IMAGE_DONE)
            on_error.pop_all()
        self._free: int | None = None
        self._size = (0, 0)
        self._placed: tuple[int, int, int] | None = None
        self._is_running = False

    @classmethod
    @checked
    def simulated(
        cls, config: str = "small", overrides: Overrides = (), *, memory: int = 1 << 26, progress: Progress = QUIET
    ) -> ShellDevice:
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
    def uio(cls, path: str = "/dev/uio0", config: str = "small", overrides: Overrides = ()) -> ShellDevice:
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
    ) -> ShellDevice:
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

    @exclusive
    def load(self, image: SceneImage) -> None:
        """See `Device`."""
        require_format(image, self.manifest)
        self._require_idle()
        base, free = self.transport.base, self.transport.base
        content = device_image(image, self.manifest)
        free = self._stored("the scene", free, content)
        self._begin(None)
        self._check(self._driver.load(content, base, self._window(base, len(content)), False))
        if self._design.numbers["scene_page"]:
            records = dram_image(image, self.manifest)
            address, free = free, self._stored("the scene", free, records)
            self._check(self._driver.set_scene(address))
        self._free = free

    @exclusive
    def set_frame(self, registers: Mapping[str, int], photo: Pixels | None = None) -> None:
        """See `Device`."""
        if self._free is None:
            raise UserError("no scene is loaded: load one before the frame")
        self._require_idle()
        check_frame(registers, photo, self.manifest)
        self._check(self._driver.set_frame(frame_file(registers, self.manifest)))
        self._size = registers["frame.width"], registers["frame.height"]
        self._end = self._free
        if photo is None:
            self._check(self._driver.clear_photo())
            return
        lines = photo_lines(photo, self._design.numbers["tile_size"])
        self._end = self._stored("the photo", self._free, lines.tobytes())
        window = self._window(self._free, lines.size)
        self._check(self._driver.set_photo(self._free, lines.shape[1], window, photo.shape[2] == 4))

    @exclusive
    def start(self, pixel_format: int = 0, address: int | None = None) -> None:
        """See `Device`.

        Args:
            pixel_format: Of the framebuffer, a code of `colonnade.common.framebuffer_formats.FORMATS`.
            address: Bus address of the framebuffer, a multiple of 4096; None: behind scene and photo.
        """
        width, height = self._size
        if width == 0:
            raise UserError("no frame is set: set its registers before the start")
        if not 0 <= pixel_format < len(FORMATS):
            raise UserError(f"pixel_format is {pixel_format}: it must be from 0 to 2, for {', '.join(FORMATS)}")
        tile = self._design.numbers["tile_size"]
        stride = -(-width // tile) * tile * PIXEL_BYTES[pixel_format]
        base = self._end if address is None else address
        self._require_memory("the frame", base, stride * height)
        self._driver.acknowledge(_FRAME_DONE | _ERROR)
        self._check(self._driver.start(base, stride, pixel_format, self._window(base, stride * height)))
        self._placed, self._format, self._is_running = (base, stride, height), pixel_format, True

    @exclusive
    def wait(self, timeout: float | None = None) -> None:
        """See `Device`."""
        self.wait_for_end(timeout)
        result = self._driver.result()
        if result == "frameInvalid":
            bits = self._driver.device_errors()
            require_no_errors(
                [name.removeprefix("errors.") for n, name in self._design.errors.items() if bits >> n & 1]
            )
        self._check(result)

    @exclusive
    def wait_for_end(self, timeout: float | None = None) -> None:
        """Wait for the end of the frame, also of one with an error.

        Args:
            timeout: As in `wait`.

        Raises:
            UserError: The frame has not ended in time.
        """
        self._require_frame()
        self._begin(timeout)
        self._check(self._driver.wait(_FRAME_DONE))
        self._driver.acknowledge(_FRAME_DONE | _ERROR)
        self._is_running = False

    @exclusive
    def counters(self) -> dict[str, int]:
        """See `Device`."""
        self._require_frame()
        names = self._design.counters
        return {name.removeprefix("counters."): int(self._driver.counter(n)) for n, name in names.items()}

    @exclusive
    def pixels(self) -> Pixels:
        """See `Device`; of a frame in format 0."""
        lines = self.lines()
        if self._format:
            raise UserError(f"the frame is in {FORMATS[self._format]}, which has no such pixels: read its lines")
        return rgb_of(lines, self._size[0])

    @exclusive
    def lines(self) -> Pixels:
        """The framebuffer in memory, in any format: uint8 [height, stride]."""
        base, stride, height = self._require_frame()
        return np.frombuffer(self.transport.fetch(base, stride * height), np.uint8).reshape(height, stride)

    @exclusive
    def register(self, name: str) -> int:
        """The value of a register of the device, by its name in the manifest.

        Raises:
            UserError: There is no such register.
        """
        register = self.manifest.registers.get(name)
        if register is None:
            raise UserError(f"there is no register {name}: give the name of one in the manifest of the design")
        first = self._table.device.base + 4 * register.address
        return register.decode([self.transport.read32(first + 4 * word) for word in range(register.words)])

    @exclusive
    def reset(self) -> None:
        """End what runs; the scene stays, the registers do not.

        Raises:
            UserError: The memory never answers.
        """
        self._begin(None)
        self._check(self._driver.reset())
        self._driver.acknowledge(_FRAME_DONE | _IMAGE_DONE | _ERROR)
        self._size, self._placed, self._is_running = (0, 0), None, False

    def _release(self) -> None:
        """A board's frame goes on."""
        self.transport.close()

    def _begin(self, timeout: float | None) -> None:
        self._paced.deadline = time.monotonic() + (self.transport.patience if timeout is None else timeout)

    def _check(self, error: str) -> None:
        if error != "ok":
            raise UserError(f"{_MEANINGS.get(error, 'the driver has refused the call')} ({error})")

    def _require_idle(self) -> None:
        if self._is_running:
            raise UserError("a frame runs: wait for its end")

    def _require_frame(self) -> tuple[int, int, int]:
        if self._placed is None:
            raise UserError("no frame was started: start one before its result is read")
        return self._placed

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
