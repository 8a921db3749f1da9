"""The look of a photo's camera, for the object that is composited into it: grain and blur."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from colonnade.common.accumulation import Accumulation
from colonnade.common.image_io import resized_photo
from colonnade.common.srgb import linear_from_srgb, srgb_from_linear
from colonnade.common.types import Floats
from colonnade.environment.model import Environment
from colonnade.environment.photo_blur import measured_blur
from colonnade.environment.photo_grain import Grain
from colonnade.scene.model import Scene

#: What `measured_blur` finds in pictures of path tracers at most; their pixels are as sharp as a frame's. The
#: least blur that is given, pixels.
_OWN_BLUR, _LEAST_BLUR = 0.75, 0.4


@dataclass(frozen=True)
class CameraLook:
    """What the object in a photo lacks.

    Attributes:
        grain: The photo's; None without any.
        blur: Standard deviation, pixels; 0 for a photo that is as sharp as a frame.
    """

    grain: Grain | None
    blur: float

    @staticmethod
    def of(scene: Scene, photo: NDArray[np.uint8] | None, size: tuple[int, int]) -> CameraLook | None:
        """The look of the photo of a scene's view; None without one, and if the scene does not want it.

        Args:
            scene: The scene.
            photo: sRGB, uint8 [rows, columns, 3].
            size: Width and height of the frame, pixels; grain and blur are the photo's in this size.
        """
        if photo is None or not scene.camera.grain:
            return None
        photo = resized_photo(photo, *size)
        blur = np.sqrt(max(measured_blur(photo) ** 2 - _OWN_BLUR**2, 0.0))
        return CameraLook(Grain.of(photo), float(blur) if blur >= _LEAST_BLUR else 0.0)

    @property
    def note(self) -> str | None:
        """Words that name what the object gets; None if that is nothing."""
        parts = [f"grain of {self.grain.grey:.1f} codes"] if self.grain is not None else []
        parts += [f"blur of {self.blur:.1f} pixels"] if self.blur else []
        return f"the photo's {' and '.join(parts)} added (camera.grain)" if parts else None

    def tell(self, room: Environment | None) -> None:
        """Add `note` to the notes on a room."""
        if room is not None and self.note is not None:
            room.tell("look", self.note)

    def blurred(self, sums: Accumulation) -> Accumulation:
        """The sums of a frame in a room with blurred objects, outlines and shadows."""
        if self.blur == 0.0 or sums.ratio is None:
            return sums

        def soft(values: NDArray[np.generic]) -> Floats:
            axes = (self.blur, self.blur) + (0.0,) * (values.ndim - 2)
            return np.asarray(ndimage.gaussian_filter(values.astype(np.float64), axes, mode="nearest"))

        ratio = soft(sums.ratio)
        if np.issubdtype(sums.ratio.dtype, np.integer):
            ratio = np.rint(ratio).astype(sums.ratio.dtype)
        return replace(sums, objects=soft(sums.objects), ratio=ratio, coverage=soft(sums.coverage))

    def grained(self, image: Floats, share: Floats, frame: int) -> Floats:
        """A composited picture with grain where it shows the object.

        Args:
            image: Linear, float64 [height, width, 3].
            share: Of each pixel that shows the object, not the photo, 0 to 1, float64 [height, width].
            frame: Number of the frame, from 0.
        """
        if self.grain is None:
            return image
        codes = 255 * srgb_from_linear(image)
        # The photo's share has its own grain
        weight = np.sqrt(1 - (1 - share.clip(0.0, 1.0)) ** 2)[..., None]
        noisy = linear_from_srgb((codes + weight * self.grain.noise(codes, frame)).clip(0, 255) / 255)
        return np.asarray(np.where(weight > 0, noisy, image))
