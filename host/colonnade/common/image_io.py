"""Reads and writes image files: 8-bit sRGB on disk (PNG, JPEG, WebP), linear colours in memory."""

from __future__ import annotations

import contextlib
import functools
import io
import warnings
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from colonnade.common.atomic_files import replacing
from colonnade.common.errors import UserError
from colonnade.common.input_files import read_input
from colonnade.common.limits import MAX_PICTURE_BYTES, MAX_PIXELS
from colonnade.common.srgb import linear_from_srgb, srgb_from_linear

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray
    from PIL.Image import Image as PillowImage

#: Formats that are read, with the bytes that they begin with; Pillow decodes them without external programs.
FORMATS = {"PNG": b"\x89PNG", "JPEG": b"\xff\xd8\xff", "WEBP": b"RIFF"}
#: A format of textures, which has no such bytes: the suffix of the file's name decides.
TARGA = "TGA"
#: The tag of EXIF data on how a picture is seen, and what its values do.
_ORIENTATION = 0x0112
_CHANGES = dict.fromkeys((3, 6, 8), "rotate") | dict.fromkeys((2, 4, 5, 7), "mirror")
#: Duration of an animation frame.
FRAME_MILLISECONDS = 50


class UnknownFormat(UserError):
    """A picture has none of the formats that are read."""


class TooManyPixels(UserError):
    """A picture has more than `MAX_PIXELS`."""


def encode_srgb(linear: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Linear colours (any shape, 0.0 to 1.0, saturated) as 8-bit sRGB, rounded to nearest."""
    import numpy as np

    return np.rint(srgb_from_linear(linear) * 255.0).astype(np.uint8)


def decode_srgb(encoded: NDArray[np.uint8]) -> NDArray[np.float64]:
    """8-bit sRGB (any shape) as linear colours, 0.0 to 1.0."""
    return _linear_codes()[encoded]


@functools.cache
def _linear_codes() -> NDArray[np.float64]:
    """The linear colour of each code, float64 [256]."""
    import numpy as np

    return linear_from_srgb(np.arange(256) / 255.0)


def resized_photo(photo: NDArray[np.uint8], width: int, height: int) -> NDArray[np.uint8]:
    """A photo, or a map of one channel, in the size of a frame: uint8 [height, width, …]."""
    if photo.shape[:2] == (height, width):
        return photo
    import numpy as np
    from PIL import Image

    return np.asarray(Image.fromarray(photo).resize((width, height), Image.Resampling.BOX))


def write_png(path: Path, linear: NDArray[np.float64]) -> None:
    """Write a picture of linear colours, float64 [height, width, 3], as an 8-bit sRGB PNG."""
    from PIL import Image

    with replacing(path) as stream:
        Image.fromarray(encode_srgb(linear)).save(stream, format="PNG")


def write_webp(path: Path, frames: Iterable[NDArray[np.uint8]]) -> None:
    """Write an endless lossless WebP animation of 8-bit sRGB pictures, uint8 [height, width, 3].

    Each frame is shown for `FRAME_MILLISECONDS`.
    """
    from PIL import Image

    first, *others = (Image.fromarray(frame) for frame in frames)
    with replacing(path) as stream:
        first.save(
            stream,
            format="WEBP",
            save_all=True,
            append_images=others,
            duration=FRAME_MILLISECONDS,
            loop=0,
            lossless=True,
        )


@contextlib.contextmanager
def opened_picture(path: Path, missing: str | None = None) -> Iterator[PillowImage]:
    """Open a PNG, JPEG or WebP picture; the content decides the format, not the file name.

    Raises:
        UserError: The file has another format, too many pixels, or cannot be decoded.
    """
    with opened_bytes(read_input(path, "the picture", MAX_PICTURE_BYTES, missing), str(path)) as picture:
        yield picture


@contextlib.contextmanager
def opened_bytes(data: bytes, name: str, formats: Iterable[str] = FORMATS) -> Iterator[PillowImage]:
    """As `opened_picture`, of a picture's bytes; ``name`` names it in messages."""
    from PIL import Image, UnidentifiedImageError

    too_large = TooManyPixels(f"{name} has too many pixels: a picture may have {MAX_PIXELS:,}")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            with Image.open(io.BytesIO(data), formats=tuple(formats)) as picture:
                if picture.width * picture.height > MAX_PIXELS:
                    raise too_large
                yield picture
    except (UserError, MemoryError):
        raise
    except Image.DecompressionBombError:
        raise too_large from None
    except UnidentifiedImageError:
        if any(data.startswith(first) for first in FORMATS.values()) or TARGA in formats:
            raise UserError(f"{name} is not a readable picture: it is truncated or damaged") from None
        raise UnknownFormat(f"{name} is not a readable picture: give a PNG, JPEG or WebP file") from None
    except Exception as error:  # decoders raise many types on invalid data
        raise UserError(f"{name} is not a readable picture: {type(error).__name__}: {error}") from None


def read_picture(path: Path) -> NDArray[np.uint8]:
    """Read a picture of 8 or 16 bits per channel as 8-bit sRGB, uint8 [height, width, 3]; alpha is dropped."""
    with opened_picture(path, f"no picture {path}: check the path") as picture:
        return rgb_pixels(picture)


def rotation_notes(path: Path) -> list[str]:
    """A line on a photo whose EXIF data rotate or mirror it, which `read_picture` does not."""
    orientation = 1
    with opened_picture(path) as picture, contextlib.suppress(Exception):  # of damaged EXIF data
        orientation = picture.getexif().get(_ORIENTATION, 1)
    change = _CHANGES.get(orientation)
    return [f"{path}: its pixels are used as they lie, its EXIF data {change} them"] if change else []


def alpha_pixels(picture: PillowImage) -> NDArray[np.uint8] | None:
    """The alpha of a picture, uint8 [height, width]; None if it is opaque."""
    import numpy as np

    if not picture.has_transparency_data:
        return None
    alpha = np.asarray(picture.convert("RGBA").getchannel("A"))
    return alpha if (alpha < 255).any() else None


def rgb_pixels(picture: PillowImage) -> NDArray[np.uint8]:
    """The pixels of a picture as 8-bit sRGB, uint8 [height, width, 3]."""
    import numpy as np

    if picture.mode.startswith("I"):  # 16-bit grey, which Pillow's convert would clip at 255
        samples = np.asarray(picture).clip(0, 65535).astype(np.uint32)
        grey = ((samples + 128) // 257).astype(np.uint8)
        return np.repeat(grey[..., np.newaxis], 3, axis=2)
    return np.asarray(picture.convert("RGB"))
