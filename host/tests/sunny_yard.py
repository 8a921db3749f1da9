"""A room whose photo shows sun and shade."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from colonnade.common.image_io import encode_srgb
from colonnade.environment.lights import world_surface
from colonnade.environment.model import Environment, EnvironmentCamera

WIDTH, HEIGHT, EYE, WALL = 128, 96, 1.5, 5.0
SHADE, SUN = np.array([0.3, 0.34, 0.4]), np.array([0.75, 0.65, 0.5])


def yard(sun: np.ndarray = SUN, ground: np.ndarray | None = None, has_shadows: bool = True) -> Environment:
    """Tiles before a wall; where x is from -1 to 1, both are in the shade."""
    pose = np.column_stack([np.diag([1.0, -1.0, -1.0]), [0.0, EYE, 0.0]])
    camera = EnvironmentCamera(90.0, 90.0, WIDTH / 2, 20.0, pose)
    rays = camera.directions(WIDTH, HEIGHT)
    depth = np.minimum(EYE / rays[..., 1].clip(min=1e-6), WALL)
    is_ground = depth < WALL
    normals = np.where(is_ground[..., None], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0])
    room = Environment("yard", np.full(normals.shape, 0.5), normals, depth, True, camera, None)
    x, _, z = np.moveaxis(world_surface(room)[0], -1, 0)
    tile = (np.floor(2 * x) + np.floor(2 * z)) % 2
    albedo = np.where(is_ground & (tile > 0), 0.45, 0.6)[..., None] * np.ones(3)
    if ground is not None:
        albedo = np.where((is_ground & (np.abs(x) > 1))[..., None], ground, 0.12)
    share = np.where(np.abs(x) > 1, 1.0, 0.0) if has_shadows else np.zeros_like(x)
    return replace(room, photo=encode_srgb(albedo * (SHADE + share[..., None] * sun)))
