"""Reads the files of a room: pictures of 8 or 16 bits, colour or grey, and arrays; as numbers, with nothing judged."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from colonnade.errors import UserError


def find(folder: Path, names: Sequence[str]) -> Path | None:
    """The first of ``names`` that is a file in ``folder``."""
    return next((folder / name for name in names if (folder / name).is_file()), None)


def read_json(file: Path) -> dict[str, Any]:
    """The JSON object in ``file``."""
    try:
        data = json.loads(file.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise UserError(f"there is no {file}: a room needs its camera there") from None
    except OSError as error:
        raise UserError(f"cannot read {file}: {error.strerror}") from None
    except ValueError as error:
        raise UserError(f"{file} is not JSON: {error}") from None
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
    """The numbers in a .npy file, two-dimensional: float64 [height, width]."""
    try:
        array = np.load(file, allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise UserError(f"{file} is no readable array: {error}") from None
    if not isinstance(array, np.ndarray) or array.dtype.kind not in "fiu":
        raise UserError(f"{file} must hold an array of numbers")
    if array.ndim == 3 and array.shape[2] == 1:
        array = array[..., 0]
    if array.ndim != 2:
        raise UserError(f"{file} must hold one number for each pixel: its shape is {array.shape}")
    numbers: NDArray[np.float64] = array.astype(np.float64)
    return numbers


def _samples(file: Path) -> NDArray[Any]:
    """uint8 or uint16 [height, width, 1 or 3] of a picture."""
    samples: NDArray[Any]
    try:
        with Image.open(file) as picture:
            if picture.mode.startswith("I;16"):
                samples = np.asarray(picture).astype(np.uint16)
                return samples[..., np.newaxis]
            if picture.mode == "F":
                raise UserError(f"{file} holds real numbers: give 8 or 16 bits a sample")
            if picture.mode == "I":
                samples = np.clip(np.asarray(picture, dtype=np.float64), 0, 65535).astype(np.uint16)
                return samples[..., np.newaxis]
            grey = picture.mode in ("1", "L", "LA", "La")
            samples = np.asarray(picture.convert("L" if grey else "RGB"))
            return samples[..., np.newaxis] if grey else samples
    except FileNotFoundError:
        raise UserError(f"there is no {file}") from None
    except (UnidentifiedImageError, OSError, SyntaxError, ValueError) as error:
        raise UserError(f"{file} is no readable picture: {error}") from None
