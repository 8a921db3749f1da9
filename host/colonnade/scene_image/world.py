"""The cube of a scene of instances (docs/numbers.md, section 10)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from colonnade.scene_image.header import Instance, ObjectFrame


def world_frame(instances: Sequence[Instance], numbers: Mapping[str, int]) -> ObjectFrame:
    """The frame of a world whose cube holds all instances."""
    corners = np.concatenate([instance.corners for instance in instances])
    low, high = corners.min(axis=0), corners.max(axis=0)
    scale = float(((1 << numbers["vertexBits"]) - 3) / (high - low).max())
    middle = (low + high) / 2 - (1 << numbers["vertexBits"]) / 2 / scale
    return ObjectFrame(scale, (float(middle[0]), float(middle[1]), float(middle[2])))


def world_bounds(
    instances: Sequence[Instance], world: ObjectFrame, numbers: Mapping[str, int]
) -> tuple[tuple[int, int, int], tuple[int, int, int]]:
    """The box of all instances, low and high, vertex units of the world, inclusive."""
    corners = (np.concatenate([instance.corners for instance in instances]) - world.offset) * world.scale
    low = np.maximum(np.floor(corners.min(axis=0)) - 1, 0).astype(int).tolist()
    high = np.minimum(np.ceil(corners.max(axis=0)) + 1, (1 << numbers["vertexBits"]) - 1).astype(int).tolist()
    return (low[0], low[1], low[2]), (high[0], high[1], high[2])
