"""The report of frames in known rooms: a table, and pictures side by side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from colonnade.common.atomic_files import replacing
from numpy.typing import NDArray

from colonnade_lab.evaluation.light.columns import FrameResult

#: Pictures side by side, sRGB, uint8 [height, width, 3].
Strip = NDArray[np.uint8]

#: The columns that are seen side by side, and a user's room's, which has no frame of ambient light.
SIDE_BY_SIDE = ("truth", "probe, rasteriser", "ambient light", "1 pass, filtered", "16 passes, filtered")
USERS_SIDE_BY_SIDE = ("truth", "probe, rasteriser", "1 pass, filtered", "16 passes, filtered", "photo alone")
#: Pixels around the objects, width of the pictures side by side, pixels, and their quality in JPEG.
_MARGIN, _WIDTH, _QUALITY = 10, 1200, 80


def table(results: Mapping[str, FrameResult]) -> str:
    """A line for each frame and column: decibels and FLIP of frame, objects, and the room that changes."""
    lines = []
    for name, result in results.items():
        lines.append(f"{name}: {result.pixels[0]:,} pixels of objects, {result.pixels[1]:,} of the room that changes")
        for column, own in result.qualities.items():
            parts = ((own.frame, own.frame_flip), (own.object, own.object_flip), (own.room, own.room_flip))
            text = "  ".join(f"{psnr:5.1f} dB {flip:.3f}" for psnr, flip in parts)
            things = ", ".join(f"{kind} {value:.1f}" for kind, value in own.things.items())
            brightness = "" if own.brightness is None else f", light {own.brightness:.2f}"
            lines.append(f"  {column:24} {text}  {things}{brightness}")
        for kind, errors in (result.mirrors or {}).items():
            lines.append(f"  mirror rays of {kind}: {errors.rays:,}, {errors.median:.1f}°, 90 %: {errors.high:.1f}°")
    return "\n".join(lines)


def write_pictures(folder: Path, name: str, pictures: Mapping[str, NDArray[np.uint8]]) -> Strip:
    """Write the pictures of a frame, sRGB, as PNG files; returns those side by side, around the objects."""
    write_frames(folder / name, pictures)
    changed = np.abs(pictures["truth"].astype(int) - pictures["no object"]).max(axis=2) > 40
    rows, columns = (np.flatnonzero(changed.any(axis=axis)) for axis in (1, 0))
    box = tuple(slice(max(0, int(span[0]) - _MARGIN), int(span[-1]) + _MARGIN) for span in (rows, columns))
    titles = SIDE_BY_SIDE if set(SIDE_BY_SIDE) <= set(pictures) else USERS_SIDE_BY_SIDE
    return np.concatenate([pictures[title][box] for title in titles], axis=1)


def write_frames(folder: Path, pictures: Mapping[str, NDArray[np.uint8]]) -> None:
    """Write pictures, sRGB, uint8 [height, width, 3], by their titles as PNG files of a folder, which is made."""
    from PIL import Image

    folder.mkdir(exist_ok=True)
    for title, picture in pictures.items():
        with replacing(folder / f"{title.replace(', ', '-').replace(' ', '-')}.png") as stream:
            Image.fromarray(picture).save(stream, "PNG")


def write_strips(file: Path, strips: Sequence[Strip]) -> None:
    """Write pictures that stand side by side, one row below the other, as JPEG."""
    from PIL import Image

    rows = [Image.fromarray(strip) for strip in strips]
    scaled = [row.resize((_WIDTH, round(row.height * _WIDTH / row.width)), Image.Resampling.BICUBIC) for row in rows]
    with replacing(file) as stream:
        Image.fromarray(np.concatenate([np.asarray(row) for row in scaled])).save(stream, "JPEG", quality=_QUALITY)
