"""The camera of a scene, its frames, and the motion over them."""

from __future__ import annotations

from dataclasses import field
from typing import Annotated

from annotated_types import Ge, Interval
from pydantic import Strict, StrictBool, model_validator
from pydantic.dataclasses import dataclass
from typing_extensions import Self

from colonnade.common.limits import MAX_SAMPLES
from colonnade.scene.model.values import STRICT, Degrees, Denoiser, Diameter, Float, Fraction, RoomPixel, WorldVector


@dataclass(frozen=True, config=STRICT)
class Camera:
    """A camera at a position, or framing the object from a direction.

    Attributes:
        position: World position; None for a framing camera.
        target: World point at the picture's centre; None is the centre of the object's cube.
        direction: From the centre of the object's cube towards a framing camera.
        framing: Fraction of the picture's height that the object's outline covers; less if its width would not fit.
        up: Up direction.
        fov: Vertical field of view, degrees; None: 40, in a room the lens of its maps.
        aperture: Diameter of the lens, world units; 0: a pinhole, everything is in focus.
        focus: Distance of the plane in focus along the view, world units; None: the plane through the target, or
            through the centre of the object's cube.
        grain: In a photo the object has the grain and the blur of its camera.
    """

    position: WorldVector | None = None
    target: WorldVector | None = None
    direction: WorldVector = (0.45, 0.35, 1.0)
    framing: Annotated[Float, Interval(ge=0.01, le=4.0)] = 0.7
    up: WorldVector = (0.0, 1.0, 0.0)
    fov: Annotated[Float, Interval(ge=1.0, le=150.0)] | None = None
    aperture: Diameter = 0.0
    focus: Annotated[Float, Interval(ge=1e-6, le=1e9)] | None = None
    grain: StrictBool = True

    @model_validator(mode="after")
    def _has_axes(self) -> Self:
        if self.target is not None and self.position is None:
            raise ValueError("camera.target needs camera.position")
        if self.focus is not None and self.aperture == 0.0:
            raise ValueError("camera.focus needs camera.aperture: a pinhole has everything in focus")
        for name, value in (("up", self.up), ("direction", self.direction)):
            if not any(value):
                raise ValueError(f"camera.{name} must not be zero")
        return self


@dataclass(frozen=True, config=STRICT)
class CameraKey:
    """A camera's place at a moment of the motion: a table ``[[motion.camera]]``.

    Attributes:
        at: Progress of the motion.
        position: World position.
        target: World point at the picture's centre; None: the key's before, or the start's.
    """

    position: WorldVector = field(kw_only=True)
    target: WorldVector | None = None
    at: Fraction = 1.0


@dataclass(frozen=True, config=STRICT)
class Motion:
    """The motion of the object, or of all as one, and of the first light over a sequence of frames, from the scene on.

    Attributes:
        turn: Rotation of the object about the vertical through its centre, degrees. None: 360 if nothing else moves,
            0 otherwise (`degrees`).
        stand_at: Last value of ``object.stand_at``; the object moves straight to that surface point.
        translate: Last value of ``transform.translate``, for an object that does not stand in a room; of several
            objects, the shift of all.
        light: Last world position of the first light.
        camera: Places of the camera by ascending progress; straight ways in between, from the scene's camera on.
        shutter: How long each frame is exposed, as a fraction of the interval to the next one.
    """

    turn: Degrees | None = None
    stand_at: RoomPixel | None = None
    translate: WorldVector | None = None
    light: WorldVector | None = None
    camera: tuple[CameraKey, ...] = ()
    shutter: Fraction = 0.0

    @model_validator(mode="after")
    def _ascends(self) -> Self:
        times = [key.at for key in self.camera]
        if sorted(set(times)) != times:
            raise ValueError("motion.camera.at must ascend from key to key")
        return self

    @property
    def degrees(self) -> float:
        """Rotation of the object, degrees."""
        return self.turn if self.turn is not None else 360.0 if self._only_turns else 0.0

    @property
    def is_still(self) -> bool:
        """Whether nothing moves."""
        return self.is_closed and self.degrees == 0.0

    @property
    def is_closed(self) -> bool:
        """Whether the last state equals the first."""
        return self._only_turns and self.degrees % 360.0 == 0.0

    @property
    def _only_turns(self) -> bool:
        return self.stand_at is None and self.translate is None and self.light is None and not self.camera


@dataclass(frozen=True, config=STRICT)
class FrameSize:
    """Default size of the frame, pixels, and the samples of each pixel.

    Attributes:
        samples: None: `colonnade.render.samples` chooses.
        budget: Seconds of the device at 200 MHz for a frame that gathers light and names no samples. None: a thirtieth.
        denoise: The noise of gathered light is filtered, in frames of the model and the RTL: by the host's own filter,
            ``atrous`` or true, or by Open Image Denoise, ``oidn``. None: `colonnade.render.room_defaults` chooses.
    """

    width: Annotated[int, Strict(), Ge(1)] = 640
    height: Annotated[int, Strict(), Ge(1)] = 480
    samples: Annotated[int, Strict(), Interval(ge=1, le=MAX_SAMPLES)] | None = None
    budget: Annotated[Float, Interval(ge=1e-6, le=1e3)] | None = None
    denoise: StrictBool | Denoiser | None = None
