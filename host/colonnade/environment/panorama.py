"""Panoramas: radiance by direction around a point, from an equirectangular picture.

A row is a height, from straight up to straight down. A column is an azimuth. The middle of the picture looks along
world -z, and a quarter of its width further right along +x.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from colonnade.common.errors import UserError
from colonnade.common.extras import require_extra
from colonnade.common.image_io import FORMATS, decode_srgb, read_picture
from colonnade.common.input_files import read_input
from colonnade.common.limits import MAX_PICTURE_BYTES, MAX_PIXELS
from colonnade.common.types import Floats
from colonnade.environment.light_cube import LightCube

#: Rows of a panorama in memory, at least; a larger picture is averaged to as many.
ROWS = 256
#: Formats of linear light: the name of the library's reader, and how a file begins.
_LINEAR = {"hdr": (b"#?",), "openexr": (b"\x76\x2f\x31\x01",)}
#: Largest deviation of the proportions from 2:1.
_MAX_STRETCH = 0.02


@dataclass(frozen=True)
class Panorama:
    """Radiance by direction.

    Attributes:
        radiance: Linear, float64 [height, width, 3].
        yaw: Rotation about world y, degrees; counter-clockwise as seen from above, as an object's turn.
    """

    radiance: Floats
    yaw: float = 0.0

    def directions(self) -> Floats:
        """Unit directions through the middles of the pixels, world space, float64 [height, width, 3]."""
        height, width = self.radiance.shape[:2]
        polar = (np.arange(height)[:, None] + 0.5) * (np.pi / height)
        azimuth = (np.arange(width) + 0.5) * (2 * np.pi / width) - np.pi - np.radians(self.yaw)
        across = np.sin(polar)
        up = np.broadcast_to(np.cos(polar), (height, width))
        return np.stack([across * np.sin(azimuth), up, -across * np.cos(azimuth)], axis=2)

    def solid_angles(self) -> Floats:
        """Solid angle of each pixel, float64 [height, 1]; all together 4π."""
        height, width = self.radiance.shape[:2]
        edges = np.cos(np.arange(height + 1) * (np.pi / height))
        return np.asarray((edges[:-1] - edges[1:])[:, None] * (2 * np.pi / width))

    def at(self, directions: Floats) -> Floats:
        """Radiance from directions of any length, world space, float64 [n, 3] each: that of the nearest pixel."""
        height, width = self.radiance.shape[:2]
        x, y, z = directions.T
        row = np.arctan2(np.hypot(x, z), y) * (height / np.pi)
        column = (np.arctan2(x, -z) + np.radians(self.yaw)) * (width / (2 * np.pi)) + width / 2
        return np.asarray(
            self.radiance[np.clip(row, 0, height - 1).astype(np.intp), np.floor(column).astype(np.intp) % width]
        )

    def mean(self) -> Floats:
        """The mean over all directions, float64 [3]."""
        return np.asarray((self.radiance * self.solid_angles()[..., None]).sum(axis=(0, 1)) / (4 * np.pi))

    def cube(self, size: int) -> LightCube:
        """The cube of these directions, of at most 32 texels along an edge, each the mean of the pixels in it."""
        texel = LightCube(np.zeros((6, size, size, 3))).texel_of(self.directions().reshape(-1, 3))
        weights = np.broadcast_to(self.solid_angles(), self.radiance.shape[:2]).ravel()
        light = self.radiance.reshape(-1, 3) * weights[:, None]
        count = 6 * size * size
        sums = np.stack([np.bincount(texel, light[:, channel], count) for channel in range(3)], axis=1)
        return LightCube((sums / np.bincount(texel, weights, count)[:, None]).reshape(6, size, size, 3))

    def scaled(self, exposure: float) -> Panorama:
        """The panorama with its radiance times a factor."""
        return replace(self, radiance=self.radiance * exposure)


def read_panorama(path: Path, yaw: float = 0.0) -> Panorama:
    """Read an equirectangular picture (`read_radiance`); one of more than `ROWS` rows is averaged.

    Raises:
        UserError: See `read_radiance`.
    """
    return _resized(Panorama(read_radiance(path), yaw))


def read_radiance(path: Path) -> Floats:
    """Read an equirectangular picture: Radiance HDR or OpenEXR, linear, or PNG, JPEG or WebP, sRGB.

    Returns:
        Linear radiance, float64 [height, width, 3]; negative one counts as 0.

    Raises:
        UserError: The file is missing or damaged, has another format, is not twice as wide as high, or holds light that
            is not finite.
    """
    first = read_input(path, "the panorama", MAX_PICTURE_BYTES, f"no panorama {path}: check background.panorama")[:8]
    reader = next((name for name, starts in _LINEAR.items() if first.startswith(starts)), None)
    if reader is not None:
        radiance = _linear(path, reader)
    elif any(first.startswith(start) for start in FORMATS.values()):
        radiance = decode_srgb(read_picture(path))
    else:
        raise UserError(f"{path} is not a readable panorama: give a Radiance HDR, OpenEXR, PNG, JPEG or WebP file")
    height, width = radiance.shape[:2]
    if abs(width - 2 * height) > 2 * _MAX_STRETCH * height:
        raise UserError(
            f"{path} is {width}x{height} pixels: a panorama is equirectangular, twice as wide as high, and shows all"
            " directions"
        )
    if not np.isfinite(radiance).all():
        raise UserError(f"{path} holds light that is not finite: repair these pixels")
    return np.asarray(radiance.clip(min=0.0))


def _linear(path: Path, reader: str) -> Floats:
    """Read a picture of linear light, float64 [height, width, 3]."""
    require_extra("panorama", f"the panorama {path.name}")
    import OpenImageIO

    picture = OpenImageIO.ImageInput.open(str(path))
    if picture is None or picture.format_name() != reader:
        raise _damaged(path, OpenImageIO.geterror())
    try:
        spec = picture.spec()
        if spec.width * spec.height > MAX_PIXELS:
            raise UserError(f"{path} has too many pixels: a picture may have {MAX_PIXELS:,}")
        if spec.depth > 1 or spec.deep:
            raise UserError(f"{path} has volumes or deep pixels: give a flat panorama")
        names = list(spec.channelnames)
        wanted = ["R", "G", "B"] if "R" in names else ["Y"]
        if not all(name in names for name in wanted):
            raise UserError(f"{path} has the channels {', '.join(names)}: a panorama needs R, G, B, or Y")
        pixels = picture.read_image(0, 0, 0, spec.nchannels, "float")
        if pixels is None:
            raise _damaged(path, picture.geterror())
    finally:
        picture.close()
    found = np.asarray(pixels, dtype=np.float64).reshape(spec.height, spec.width, spec.nchannels)
    return np.broadcast_to(found[..., [names.index(name) for name in wanted]], (spec.height, spec.width, 3))


def _damaged(path: Path, reason: str) -> UserError:
    line = reason.splitlines()[0] if reason else "truncated or damaged"
    return UserError(f"{path} is not a readable panorama: {line}")


def _resized(panorama: Panorama) -> Panorama:
    """A panorama of `ROWS` rows, or of up to twice as many where a small one repeats its pixels.

    The pixels of a larger one are means by solid angle.
    """
    height, width = panorama.radiance.shape[:2]
    if height <= ROWS:
        times = -(-ROWS // height)
        return replace(panorama, radiance=panorama.radiance.repeat(times, axis=0).repeat(times, axis=1))
    rows, columns = np.arange(ROWS) * height // ROWS, np.arange(2 * ROWS) * width // (2 * ROWS)
    angles = np.broadcast_to(panorama.solid_angles()[..., None], (height, width, 1))
    light, whole = (
        np.add.reduceat(np.add.reduceat(values, rows, axis=0), columns, axis=1)
        for values in (panorama.radiance * angles, angles)
    )
    return replace(panorama, radiance=light / whole)
