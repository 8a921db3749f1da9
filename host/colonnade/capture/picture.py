"""Makes frames upright, crops them to the shape of the maps, and resizes photo and depth to their size."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from PIL import Image

from colonnade import _core
from colonnade.capture.source import Frame, Lens
from colonnade.common.types import Floats


def quarter_turns(to_world: Floats) -> int:
    """Counter-clockwise quarter turns after which the world's y points up in a camera's picture, 0 to 3."""
    across, down, _ = to_world[1, :3]  # of the world's y in view space
    # After one turn the picture's down is the axis -x of before, after two -y, after three x
    return int(np.argmin([down, -across, -down, across]))


def turned(frame: Frame, turns: int) -> Frame:
    """A frame after counter-clockwise quarter turns."""
    for _ in range(turns):
        lens = frame.lens
        axes = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
        frame = replace(
            frame,
            photo=np.rot90(frame.photo),
            depth=np.rot90(frame.depth),
            lens=Lens(lens.fy, lens.fx, lens.cy, frame.photo.shape[1] - lens.cx),
            to_world=np.column_stack([frame.to_world[:, :3] @ axes, frame.to_world[:, 3]]),
        )
    return frame


def fitted(frame: Frame, width: int, height: int) -> Frame:
    """The largest part around the middle with the proportions of the maps, in their size."""
    rows, columns = frame.photo.shape[:2]
    scale = min(columns / width, rows / height)
    left, top = (columns - scale * width) / 2, (rows - scale * height) / 2
    box = (left, top, left + scale * width, top + scale * height)
    filter_ = Image.Resampling.LANCZOS if scale > 1 else Image.Resampling.BICUBIC
    photo = Image.fromarray(np.ascontiguousarray(frame.photo))
    lens = frame.lens
    depth = np.ascontiguousarray(frame.depth, dtype=np.float64)
    return replace(
        frame,
        photo=np.asarray(photo.resize((width, height), filter_, box=box)),
        depth=_core.fitted_depth(depth, (columns, rows), (left, top, scale), width, height),
        lens=Lens(lens.fx / scale, lens.fy / scale, (lens.cx - left) / scale, (lens.cy - top) / scale),
    )
