"""Reads panoramas: equirectangular pictures, Radiance HDR or OpenEXR, linear, or PNG, JPEG or WebP, sRGB.

Linear ones are decoded in a process of its own, with limits of memory and time. The module is also its program.
"""

from __future__ import annotations

import io
import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from colonnade.common.decoder_process import DAMAGED, decode
from colonnade.common.errors import UserError
from colonnade.common.extras import require_extra
from colonnade.common.image_io import FORMATS, decode_srgb, read_picture
from colonnade.common.input_files import read_input
from colonnade.common.limits import MAX_PICTURE_BYTES, MAX_PIXELS
from colonnade.common.machine_limits import limit_this_process
from colonnade.common.types import Floats
from colonnade.environment.panorama import Panorama, solid_angles

#: Rows of a panorama in memory, at least; a larger picture is averaged to as many.
ROWS = 256
#: Formats of linear light: the name of the library's reader, and how a file begins.
_LINEAR = {"hdr": (b"#?",), "openexr": (b"\x76\x2f\x31\x01",)}
#: Largest deviation of the proportions from 2:1.
_MAX_STRETCH = 0.02
#: Channels of a picture.
_MAX_CHANNELS = 64
#: Rows that are decoded together, about.
_BAND = 256
#: Memory of the process beside its libraries, bytes: float32 of the largest picture, and what the library takes; and
#: its processor time, seconds.
_MEMORY, _SECONDS = MAX_PIXELS * 12 + 3 * (1 << 27), 60


def read_panorama(path: Path, yaw: float = 0.0) -> Panorama:
    """Read an equirectangular picture; one of more than `ROWS` rows is averaged, a smaller one repeats its pixels.

    Raises:
        UserError: See `read_radiance`; or it takes too much memory or time.
    """
    if _reader(path) is None:
        radiance = _averaged(path)
    else:
        done = decode("colonnade.environment.panorama_file", _MEMORY, _SECONDS, path)
        if done.returncode != 0:
            problem = done.stderr.decode("utf-8", "replace").strip() if done.returncode == DAMAGED else ""
            limits = f"takes more than {_MEMORY >> 20:,} MiB or {_SECONDS} s to decode"
            raise UserError(problem or f"the panorama {path} is damaged, or {limits}: give a smaller one")
        radiance = np.load(io.BytesIO(done.stdout), allow_pickle=False)
    times = -(-ROWS // len(radiance))
    return Panorama(radiance.repeat(times, axis=0).repeat(times, axis=1), yaw)


def read_radiance(path: Path) -> Floats:
    """Read an equirectangular picture whole, in this process.

    Returns:
        Linear radiance, float64 [height, width, 3]; negative one counts as 0.

    Raises:
        UserError: The file is missing or damaged, has another format, is not twice as wide as high, or holds light that
            is not finite.
    """
    return _light(_samples(path), path)


def _reader(path: Path) -> str | None:
    """The name of the library's reader of a picture of linear light; None for one in sRGB."""
    missing = f"no panorama {path}: check background.panorama"
    first = read_input(path, "the panorama", MAX_PICTURE_BYTES, missing, first=8)
    reader = next((name for name, starts in _LINEAR.items() if first.startswith(starts)), None)
    if reader is not None:
        require_extra("panorama", f"the panorama {path.name}")
    elif not any(first.startswith(start) for start in FORMATS.values()):
        raise UserError(f"{path} is not a readable panorama: give a Radiance HDR, OpenEXR, PNG, JPEG or WebP file")
    return reader


def _samples(path: Path) -> NDArray[Any]:
    """The samples of a picture, [height, width, 3]: float32 of linear light, or uint8 of sRGB."""
    reader = _reader(path)
    samples: NDArray[Any] = read_picture(path) if reader is None else _linear(path, reader)
    height, width = samples.shape[:2]
    if abs(width - 2 * height) > 2 * _MAX_STRETCH * height:
        raise UserError(
            f"{path} is {width}x{height} pixels: a panorama is equirectangular, twice as wide as high, and shows all"
            " directions"
        )
    return samples


def _linear(path: Path, reader: str) -> NDArray[np.float32]:
    import OpenImageIO

    # Each thread takes memory of its own
    OpenImageIO.attribute("threads", 1)
    OpenImageIO.attribute("exr_threads", -1)
    picture = OpenImageIO.ImageInput.open(str(path))
    if picture is None or picture.format_name() != reader:
        raise _damaged(path, OpenImageIO.geterror())
    try:
        spec = picture.spec()
        if spec.width * spec.height > MAX_PIXELS:
            raise UserError(f"{path} has too many pixels: a picture may have {MAX_PIXELS:,}")
        if spec.nchannels > _MAX_CHANNELS:
            raise UserError(f"{path} has {spec.nchannels:,} channels, {_MAX_CHANNELS} at most: leave out layers")
        if spec.depth > 1 or spec.deep:
            raise UserError(f"{path} has volumes or deep pixels: give a flat panorama")
        names = list(spec.channelnames)
        wanted = ["R", "G", "B"] if "R" in names else ["Y"]
        first = names.index(wanted[0]) if wanted[0] in names else 0
        end = first + len(wanted)
        if names[first:end] != wanted:
            raise UserError(f"{path} has the channels {', '.join(names)}: a panorama needs R, G, B, or Y")
        found = np.empty((spec.height, spec.width, len(wanted)), np.float32)
        # In bands of whole tiles: of the whole picture the library makes a second copy
        band = -(-_BAND // spec.tile_height) * spec.tile_height if spec.tile_height else _BAND
        for top in range(0, spec.height, band):
            rows = found[top : top + band]
            y = spec.y + top, spec.y + top + len(rows)
            if spec.tile_height:
                pixels = picture.read_tiles(0, 0, spec.x, spec.x + spec.width, *y, 0, 1, first, end, "float")
            else:
                pixels = picture.read_scanlines(0, 0, *y, 0, first, end, "float")
            if pixels is None:
                raise _damaged(path, picture.geterror())
            rows[...] = np.asarray(pixels).reshape(rows.shape)
    finally:
        picture.close()
    return np.broadcast_to(found, (spec.height, spec.width, 3))


def _damaged(path: Path, reason: str) -> UserError:
    line = reason.splitlines()[0] if reason else "truncated or damaged"
    return UserError(f"{path} is not a readable panorama: {line}")


def _light(samples: NDArray[Any], path: Path) -> Floats:
    """Linear radiance of samples, float64."""
    if samples.dtype == np.uint8:
        return decode_srgb(samples)
    if not np.isfinite(samples).all():
        raise UserError(f"{path} holds light that is not finite: repair these pixels")
    return np.asarray(samples.astype(np.float64).clip(min=0.0))


def _averaged(path: Path) -> Floats:
    """The radiance of a picture, float64; of more than `ROWS` rows means by solid angle, [`ROWS`, 2 `ROWS`, 3].

    One row of means after the other, so that few pixels are in memory as float64.
    """
    samples = _samples(path)
    height, width = samples.shape[:2]
    if height <= ROWS:
        return _light(samples, path)
    angles = np.broadcast_to(solid_angles(height, width)[..., None], (height, width, 1))
    columns = np.arange(2 * ROWS) * width // (2 * ROWS)
    means = np.empty((ROWS, 2 * ROWS, 3))
    for row, (first, end) in enumerate(pairwise(np.arange(ROWS + 1) * height // ROWS)):
        weights = angles[first:end]
        light, whole = (
            np.add.reduceat(np.add.reduceat(values, [0], axis=0), columns, axis=1)
            for values in (_light(samples[first:end], path) * weights, weights)
        )
        means[row] = light / whole
    return means


def _main() -> None:
    """Write the radiance of a picture as an NPY file to standard output, or a line on what is wrong with it."""
    import OpenImageIO  # noqa: F401  # its memory does not count

    memory, seconds, path = sys.argv[1:]
    limit_this_process(int(memory), int(seconds))
    try:
        found = io.BytesIO()  # a pipe has no position, which NumPy asks for
        np.save(found, _averaged(Path(path)))
        sys.stdout.buffer.write(found.getvalue())
    except Exception as error:  # of the library, of many types, and MemoryError
        print(error if isinstance(error, UserError) else "", file=sys.stderr)
        sys.exit(DAMAGED)


if __name__ == "__main__":
    _main()
