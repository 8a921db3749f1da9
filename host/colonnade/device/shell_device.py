"""A device of frames in its AXI4 shell."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from colonnade.common.arguments import checked
from colonnade.common.errors import UserError
from colonnade.common.framebuffer_formats import FORMATS, PIXEL_BYTES, photo_lines
from colonnade.design.generator import GeneratedDesign
from colonnade.device.device import Device, Pixels, check_frame, exclusive, require_format, require_no_errors, rgb_of
from colonnade.device.shell_base import ERROR, FRAME_DONE, IMAGE_DONE, Shell
from colonnade.device.transport import Transport
from colonnade.registers.frame_file import frame_file
from colonnade.scene_image.file import SceneImage


class ShellDevice(Shell, Device):
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
        Device.__init__(self, design.manifest)
        Shell.__init__(self, transport, design)
        self._free: int | None = None
        self._size = (0, 0)
        self._placed: tuple[int, int, int] | None = None
        self._is_running = False

    @exclusive
    def load(self, image: SceneImage) -> None:
        """See `Device`."""
        require_format(image, self.manifest)
        self._require_idle()
        self._free = self._loaded(image)

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
        self._driver.acknowledge(FRAME_DONE | ERROR)
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
        self._check(self._driver.wait(FRAME_DONE))
        self._driver.acknowledge(FRAME_DONE | ERROR)
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
        self._driver.acknowledge(FRAME_DONE | IMAGE_DONE | ERROR)
        self._size, self._placed, self._is_running = (0, 0), None, False

    def _release(self) -> None:
        """A board's frame goes on."""
        self.transport.close()

    def _require_idle(self) -> None:
        if self._is_running:
            raise UserError("a frame runs: wait for its end")

    def _require_frame(self) -> tuple[int, int, int]:
        if self._placed is None:
            raise UserError("no frame was started: start one before its result is read")
        return self._placed
