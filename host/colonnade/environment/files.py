"""Reads a room's files as numbers, without interpretation: pictures of 8 or 16 bits, and arrays."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from colonnade.common.array_files import parse_npy
from colonnade.common.errors import UserError
from colonnade.common.image_io import opened_picture
from colonnade.common.input_files import exists, read_input, read_json
from colonnade.common.limits import MAX_PIXELS, MAX_TEXT_BYTES


def find(folder: Path, names: Sequence[str]) -> Path | None:
    """The first of ``names`` that exists in ``folder``, or None."""
    return next((folder / name for name in names if exists(folder / name)), None)


def inside(folder: Path, name: str, where: str) -> Path:
    """A file that a list names, which must lie in a folder, also after links.

    Args:
        folder: The list's.
        name: Of the file, relative to the folder.
        where: What names it, for messages.

    Raises:
        UserError: It lies elsewhere.
    """
    file = folder / name
    try:
        if "\0" not in name and file.resolve().is_relative_to(folder.resolve()):
            return file
    except (OSError, RuntimeError):  # of links in a circle
        pass
    raise UserError(f"{where} names {name}: a file must lie in the folder {folder}")


def read_object(file: Path) -> dict[str, Any]:
    """Read the JSON object in ``file``."""
    data = read_json(file, "the camera", missing=f"there is no {file}: a room needs its camera in this file")
    if not isinstance(data, dict):
        raise UserError(f"{file} must contain a JSON object")
    return data


def read_channels(file: Path) -> NDArray[np.float64]:
    """Read a picture's samples, 0.0 to 1.0: float64 [height, width, 1 or 3]; alpha is dropped."""
    samples = read_samples(file)
    full = {np.dtype(np.uint8): 255.0, np.dtype(np.uint16): 65535.0}
    return samples.astype(np.float64) / full[samples.dtype]


def read_colour(file: Path) -> NDArray[np.float64]:
    """`read_channels` with grey copied to three channels: float64 [height, width, 3]."""
    samples = read_channels(file)
    return np.repeat(samples, 3, axis=2) if samples.shape[2] == 1 else samples


def read_grey(file: Path, step: float) -> NDArray[np.float64]:
    """Read the integer samples of a 16-bit grey picture, in steps of so many units: float64 [height, width]."""
    samples = read_samples(file)
    if samples.shape[2] != 1:
        raise UserError(f"{file} has colours or transparency: depth must be 16-bit grey or a .npy file")
    if samples.dtype != np.uint16:
        raise UserError(f"{file} has 8 bits per pixel, too few for depth: give 16-bit grey or a .npy file")
    return np.asarray(np.multiply(samples[..., 0], step, dtype=np.float64))


def read_array(file: Path, step: float = 1.0) -> NDArray[np.float64]:
    """Read a ``.npy`` file with one number per pixel, in steps of so many units: float64 [height, width]."""
    try:
        array = parse_npy(read_input(file, "the array", MAX_PIXELS * 8 + MAX_TEXT_BYTES))
    except ValueError as error:
        raise UserError(f"{file} is not a readable array: {error}") from None
    if array.ndim == 3 and array.shape[2] == 1:
        array = array[..., 0]
    if array.ndim != 2:
        raise UserError(f"{file} must have one number per pixel: its shape is {array.shape}")
    if array.size > MAX_PIXELS:
        raise UserError(f"{file} has too many pixels: an array may have {MAX_PIXELS:,}")
    return np.asarray(np.multiply(array, step, dtype=np.float64))


def read_samples(file: Path) -> NDArray[Any]:
    """Read a picture's samples, uint8 or uint16 [height, width, 1 or 3]; alpha is dropped."""
    samples: NDArray[Any]
    with opened_picture(file, f"there is no {file}") as picture:
        if picture.mode.startswith("I;16"):
            samples = np.asarray(picture).astype(np.uint16)
            return samples[..., np.newaxis]
        if picture.mode == "I":
            samples = np.clip(np.asarray(picture, dtype=np.float64), 0, 65535).astype(np.uint16)
            return samples[..., np.newaxis]
        grey = picture.mode in ("1", "L", "LA", "La")
        samples = np.asarray(picture.convert("L" if grey else "RGB"))
        return samples[..., np.newaxis] if grey else samples
