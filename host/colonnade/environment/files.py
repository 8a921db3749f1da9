"""Reads the files of a room: pictures of 8 or 16 bits, colour or grey, and arrays; as numbers, with nothing judged."""

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
from colonnade.common.limits import MAX_PICTURE_BYTES


def find(folder: Path, names: Sequence[str]) -> Path | None:
    """The first of ``names`` that is there in ``folder``."""
    return next((folder / name for name in names if exists(folder / name)), None)


def read_object(file: Path) -> dict[str, Any]:
    """The JSON object in ``file``."""
    data = read_json(file, "the camera", missing=f"there is no {file}: a room needs its camera there")
    if not isinstance(data, dict):
        raise UserError(f"{file} must hold a JSON object")
    return data


def read_channels(file: Path) -> NDArray[np.float64]:
    """A picture's samples, 0.0 to 1.0: float64 [height, width, 1 or 3]; transparency is dropped."""
    samples = _samples(file)
    full = {np.dtype(np.uint8): 255.0, np.dtype(np.uint16): 65535.0}
    return samples.astype(np.float64) / full[samples.dtype]


def read_colour(file: Path) -> NDArray[np.float64]:
    """`read_channels` with grey repeated for three channels: float64 [height, width, 3]."""
    samples = read_channels(file)
    return np.repeat(samples, 3, axis=2) if samples.shape[2] == 1 else samples


def read_grey(file: Path) -> NDArray[np.float64]:
    """The whole numbers of a grey picture of 16 bits: float64 [height, width]."""
    samples = _samples(file)
    if samples.shape[2] != 1:
        raise UserError(f"{file} has colours or transparency: depth must be plain grey, of 16 bits, or a .npy file")
    if samples.dtype != np.uint16:
        raise UserError(f"{file} has 8 bits a pixel, too few for depth: give grey of 16 bits, or a .npy file")
    return samples[..., 0].astype(np.float64)


def read_array(file: Path) -> NDArray[np.float64]:
    """The numbers of a ``.npy`` file: float64 [height, width]."""
    try:
        array = parse_npy(read_input(file, "the array", MAX_PICTURE_BYTES))
    except ValueError as error:
        raise UserError(f"{file} is no readable array: {error}") from None
    if array.ndim == 3 and array.shape[2] == 1:
        array = array[..., 0]
    if array.ndim != 2:
        raise UserError(f"{file} must hold one number for each pixel: its shape is {array.shape}")
    numbers: NDArray[np.float64] = array.astype(np.float64)
    return numbers


def _samples(file: Path) -> NDArray[Any]:
    """uint8 or uint16 [height, width, 1 or 3] of a picture."""
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
