"""Makes frames upright, crops them to the shape of the maps, and resizes photo and depth to their size."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from PIL import Image

from colonnade.capture.source import Frame, Lens
from colonnade.common.types import Floats

#: Neighbouring samples of depth that differ by more than this share lie on different surfaces.
_SAME_SURFACE = 0.05


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
    across, down = frame.depth.shape[1] / columns, frame.depth.shape[0] / rows
    u = (left + (np.arange(width) + 0.5) * scale) * across - 0.5
    v = (top + (np.arange(height) + 0.5) * scale) * down - 0.5
    return replace(
        frame,
        photo=np.asarray(photo.resize((width, height), filter_, box=box)),
        depth=_sampled(frame.depth, u, v),
        lens=Lens(lens.fx / scale, lens.fy / scale, (lens.cx - left) / scale, (lens.cy - top) / scale),
    )


def _sampled(depth: Floats, u: Floats, v: Floats) -> Floats:
    """Depth at columns u and rows v: on one surface linear in inverse depth, as planes are, else the nearest sample."""
    rows, columns = depth.shape
    u, v = u.clip(0, columns - 1), v.clip(0, rows - 1)
    column = np.floor(u).astype(int).clip(max=max(columns - 2, 0))
    row = np.floor(v).astype(int).clip(max=max(rows - 2, 0))
    right, below = (column + 1).clip(max=columns - 1), (row + 1).clip(max=rows - 1)
    across, down = (u - column)[np.newaxis, :], (v - row)[:, np.newaxis]
    corners = np.stack([depth[np.ix_(r, c)] for r in (row, below) for c in (column, right)])
    nearest = depth[np.ix_(np.rint(v).astype(int), np.rint(u).astype(int))]
    is_one = (corners.min(axis=0) > 0) & (corners.max(axis=0) <= corners.min(axis=0) * (1 + _SAME_SURFACE))
    inverse = 1.0 / np.where(is_one, corners, 1.0)
    weights = np.stack([(1 - across) * (1 - down), across * (1 - down), (1 - across) * down, across * down])
    return np.asarray(np.where(is_one, 1.0 / (inverse * weights).sum(axis=0), nearest))
