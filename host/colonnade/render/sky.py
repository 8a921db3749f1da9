"""The panorama behind the object, where a scene has no room."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

import numpy as np

from colonnade.common.frame_size import Size
from colonnade.common.types import Floats
from colonnade.environment.panorama import Panorama
from colonnade.environment.panorama_file import read_panorama
from colonnade.scene.model import Scene
from colonnade.scene.object_pose import Placed
from colonnade.scene.view import world_view

#: Passes whose rays count, at most.
_PASSES = 16


def sky_of(placed: Placed, passes: Sequence[Scene], size: Size) -> Floats | None:
    """What the pixels of a frame show of the panorama, the mean over its passes; None if the scene shows none.

    Args:
        placed: The scene.
        passes: The scene at each pass of the frame.
        size: Width and height, pixels.

    Returns:
        Linear radiance, float64 [height, width, 3].
    """
    background = passes[0].background
    if background.panorama is None or not background.shows_panorama:
        return None
    panorama = _panorama(background.panorama, background.panorama.stat().st_mtime_ns, background.panorama_yaw)
    surfaces = [one for one in passes if one.sample.layer == "surface"]
    surfaces = surfaces[:: -(-len(surfaces) // _PASSES)]
    x, y = np.arange(size[0])[None, :, None], np.arange(size[1])[:, None, None]
    total = np.zeros((size[1], size[0], 3))
    for one in surfaces:
        camera = world_view(placed.with_scene(one), *size).camera
        rays = camera.corner + x * camera.step_x + y * camera.step_y
        total += panorama.at(rays.reshape(-1, 3)).reshape(total.shape)
    exposure = 1.0 if background.panorama_exposure is None else background.panorama_exposure
    return np.asarray(total * (exposure / len(surfaces)))


@lru_cache(maxsize=1)
def _panorama(file: Path, _modified: int, yaw: float) -> Panorama:
    """A panorama, read once for the frames of a motion."""
    return read_panorama(file, yaw)
