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
