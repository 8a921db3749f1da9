"""A device that renders frames, with the same calls for model, simulator and board; and the model as one."""

from __future__ import annotations

import functools
import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Concatenate, NoReturn, ParamSpec, TypeVar

import numpy as np
from numpy.typing import NDArray
from typing_extensions import Self

from colonnade.common.arguments import checked, is_whole
from colonnade.common.errors import UserError
from colonnade.common.frame_size import Size
from colonnade.common.framebuffer import Frame
from colonnade.common.framebuffer_formats import framebuffer_bytes
from colonnade.common.progress import QUIET, Progress
from colonnade.design.config_name import Overrides
from colonnade.design.frame_limits import check_size
from colonnade.design.generator import manifest_for
from colonnade.design.manifest import Manifest, value_range
from colonnade.device.bit_exact import loaded_model, model_frame
from colonnade.scene.prepared.device_scene import DeviceScene
from colonnade.scene_image.file import SceneImage

Pixels = NDArray[np.uint8]
D = TypeVar("D", bound="Device")
P = ParamSpec("P")
R = TypeVar("R")


def exclusive(call: Callable[Concatenate[D, P], R]) -> Callable[Concatenate[D, P], R]:
    """A call of a device that one thread makes at a time. Its arguments are checked, and a closed device refuses it."""
    checked_call = checked(call)

    @functools.wraps(call)
    def alone(device: D, /, *args: P.args, **kwargs: P.kwargs) -> R:
        with device.lock:
            if device.is_closed:
                raise UserError("the device is closed: make another one")
            return checked_call(device, *args, **kwargs)

    return alone


class Device(ABC):
    """A device. Its calls come in this order: `load`, then for each frame `set_frame`, `start`, `wait` and what reads.

    A device is a context manager, and closed at the end of the block. Threads may share it: each call waits for those
    of the others, and `render` is one call.

    Attributes:
        manifest: The manifest of its design.
        lock: A thread that makes several calls holds it, ``with device.lock:``, so that no other's come in between.
        is_closed: Whether it was closed.
    """

    def __init__(self, manifest: Manifest) -> None:
        self.manifest = manifest
        self.lock = threading.RLock()
        self.is_closed = False

    @abstractmethod
    def load(self, image: SceneImage) -> None:
        """Load a scene: records, and maps of a room. It stays until the next load.

        Args:
            image: `DeviceScene.image`, packed for this design.

        Raises:
            UserError: It was packed for another design, or does not fit the memory.
        """

    @abstractmethod
    def set_frame(self, registers: Mapping[str, int], photo: Pixels | None = None) -> None:
        """Set the registers of the next frame.

        Args:
            registers: Values of all rw registers by name: `DeviceScene.registers`.
            photo: In a room: what frames show where the object is not, under the object's shadow. sRGB, uint8 [height,
                width, 3], in the frame's size; or [height, width, 4] with the strength of the shadow, 255 a whole one.

        Raises:
            UserError: No scene is loaded, a frame runs, or the frame is too large.
        """

    @abstractmethod
    def start(self) -> None:
        """Start the frame that is set.

        Raises:
            UserError: None is set.
        """

    @abstractmethod
    def wait(self, timeout: float | None = None) -> None:
        """Wait for the end of the frame.

        Args:
            timeout: Seconds; None: 10 on this machine's bus, 60 over a bridge, without an end in a simulator.

        Raises:
            UserError: The frame has not ended in time, or has an error bit.
        """

    @abstractmethod
    def counters(self) -> dict[str, int]:
        """The counters of the last frame, by name without ``counters.``; the model has the ones that need no clock."""

    @abstractmethod
    def pixels(self) -> Pixels:
        """The framebuffer of the last frame: sRGB, uint8 [height, width, 3]."""

    @abstractmethod
    def _release(self) -> None:
        """Release what the device holds, once."""

    def close(self) -> None:
        """Release the device, when the calls of other threads have ended; it takes no further ones."""
        with self.lock:
            if not self.is_closed:
                self.is_closed = True
                self._release()

    @exclusive
    def render(self, scene: DeviceScene, size: Size | None = None) -> Pixels:
        """Load a scene and render one frame of one sample, in the photo of its room if there is one.

        Args:
            scene: A scene that was packed for this design.
            size: Width and height, pixels; None: the scene's.

        Returns:
            As `pixels`.

        Raises:
            UserError: See the calls.
        """
        size = (scene.scene.frame.width, scene.scene.frame.height) if size is None else size
        check_size(size, self.manifest)
        self.load(scene.image)
        self.set_frame(scene.registers(size), scene.frame_photo(size))
        self.start()
        self.wait()
        return self.pixels()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def __reduce__(self) -> NoReturn:
        raise UserError("a device cannot be copied or sent to another process: make one there, from its configuration")


class ModelDevice(Device):
    """The bit-exact model as a device; `start` renders the frame.

    Args:
        config: The design: a preset, a JSON file, or a precision such as ``32b32s64d``.
        overrides: Fields that replace some of it, ``key=value``.
        progress: Shows the run of the generator.

    Raises:
        UserError: There is no such configuration.
    """

    def __init__(self, config: str = "small", overrides: Overrides = (), progress: Progress = QUIET) -> None:
        super().__init__(manifest_for(config, overrides, progress).manifest)
        self._model: Any = None
        self._set: tuple[dict[str, int], Pixels | None] | None = None
        self._frame: tuple[Frame, Pixels | None] | None = None

    @exclusive
    def load(self, image: SceneImage) -> None:
        """See `Device`."""
        require_format(image, self.manifest)
        self._model = loaded_model(self.manifest, image)

    @exclusive
    def set_frame(self, registers: Mapping[str, int], photo: Pixels | None = None) -> None:
        """See `Device`."""
        if self._model is None:
            raise UserError("no scene is loaded: load one before the frame")
        check_frame(registers, photo, self.manifest)
        self._set = dict(registers), photo

    @exclusive
    def start(self) -> None:
        """See `Device`."""
        if self._set is None:
            raise UserError("no frame is set: set its registers before the start")
        registers, photo = self._set
        self._frame = model_frame(self._model, registers), photo

    @exclusive
    def wait(self, timeout: float | None = None) -> None:
        """See `Device`. The frame has ended."""
        require_no_errors(self._last[0].errors)

    @exclusive
    def counters(self) -> dict[str, int]:
        """See `Device`."""
        return dict(self._last[0].counters)

    @exclusive
    def pixels(self) -> Pixels:
        """See `Device`."""
        frame, photo = self._last
        return rgb_of(framebuffer_bytes(frame, 0, photo), frame.is_object.shape[1])

    def _release(self) -> None:
        self._model = self._set = self._frame = None

    @property
    @exclusive
    def frame(self) -> Frame:
        """The last frame as the model has it.

        Raises:
            UserError: None was started.
        """
        return self._last[0]

    @property
    def _last(self) -> tuple[Frame, Pixels | None]:
        if self._frame is None:
            raise UserError("no frame was started: start one before its result is read")
        return self._frame


def rgb_of(lines: Pixels, width: int) -> Pixels:
    """Lines of XRGB8888, uint8 [height, stride], as uint8 [height, width, 3]."""
    return np.ascontiguousarray(lines[:, : 4 * width].reshape(len(lines), width, 4)[..., 2::-1])


def require_format(image: SceneImage, manifest: Manifest) -> None:
    """Refuse an image of another design.

    Raises:
        UserError: Its format hash differs.
    """
    if image.header.format_hash != manifest.format_hash:
        raise UserError("the scene was packed for another design: pack it with the configuration of this device")


def check_frame(registers: Mapping[str, int], photo: Pixels | None, manifest: Manifest) -> None:
    """Refuse registers that are not a frame's, and a photo that the frame cannot show.

    Raises:
        UserError: A register is missing, unknown or out of range, the frame is too large, or the photo has another size
            or no room.
    """
    known = {name: register for name, register in manifest.registers.items() if register.access == "rw"}
    for name in sorted(known.keys() ^ registers.keys()):
        what = "missing" if name in known else "none of this design"
        raise UserError(f"register {name} is {what}: give the registers of the scene, packed for this design")
    for name, value in registers.items():
        low, high = value_range(known[name].width, known[name].signed)
        if not (is_whole(value) and low <= value <= high):
            raise UserError(f"register {name} is {value!r}: it must be a whole number from {low} to {high}")
    check_size((registers["frame.width"], registers["frame.height"]), manifest)
    if photo is None:
        return
    if not registers.get("environment.enabled", 0):
        raise UserError("a photo shows behind the object of a room, and this frame has none: leave out the photo")
    height, width = registers["frame.height"], registers["frame.width"]
    if photo.shape not in ((height, width, 3), (height, width, 4)) or photo.dtype != np.uint8:
        found, wanted = f"{photo.dtype} {list(photo.shape)}", f"uint8 {[height, width, 3]}"
        raise UserError(f"the photo is {found}, the frame needs {wanted}, or 4 channels with strengths of the shadow")


def require_no_errors(errors: Sequence[str]) -> None:
    """Refuse a frame with an error bit.

    Args:
        errors: Names of the bits that are set.

    Raises:
        UserError: With advice for each.
    """
    advice = {
        "stackOverflow": "the traversal stack overflowed: raise columnBvhMemory.stackDepth",
        "memory": "a read from DRAM failed: check the scene's address and the memory",
        "illegalRecord": "a record was illegal, or a pointer left its section: pack the scene again",
        "watchdog": "the watchdog aborted the frame: the scene image may be corrupt, pack the scene again",
    }
    if errors:
        raise UserError("the frame failed: " + "; ".join(advice.get(error, error) for error in errors))
