"""The lights of a scene as `RoomLights` in world space, and found lights as a scene's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from colonnade.common.types import Floats
from colonnade.environment.lights import RoomLight, RoomLights
from colonnade.scene.model import Colour, Light, PointLight, Scene, Vector
from colonnade.scene.object_pose import Placed
from colonnade.scene.view import world_positions


def lights_of(placed: Placed) -> RoomLights:
    """The lights of a scene at the start of its motion."""
    scene = placed.scene.at(0.0)
    positions = world_positions(placed.with_scene(scene))
    return RoomLights(
        np.array(scene.ambient.colour),
        tuple(
            RoomLight(position, np.array(light.colour), light.falloff, light.radius)
            for position, light in zip(positions, scene.lights, strict=True)
        ),
    )


def with_lights(scene: Scene, lights: RoomLights) -> Scene:
    """The scene with other lights; the settings of all lights stay."""
    first, *more = lights.lights or (RoomLight(np.zeros(3), np.zeros(3), None),)
    return replace(
        scene,
        light=Light(
            as_vector(first.position),
            colour=as_vector(first.colour),
            falloff=first.falloff,
            radius=first.radius,
            shadows=scene.light.shadows,
            shadow_offset=scene.light.shadow_offset,
        ),
        more_lights=tuple(
            PointLight(
                as_vector(light.position), colour=as_vector(light.colour), falloff=light.falloff, radius=light.radius
            )
            for light in more
        ),
        ambient=Colour(as_vector(lights.ambient)),
    )


def scene_text(lights: RoomLights) -> str:
    """The tables of a scene file for these lights, TOML."""
    lines = ["[ambient]", f"colour = {_list(lights.ambient)}"]
    for light in lights.lights:
        lines += ["", "[[light]]", f"position = {_list(light.position)}", f"colour = {_list(light.colour)}"]
        lines += [] if light.falloff is None else [f"falloff = {light.falloff:g}"]
    if not lights.lights:
        lines += ["", "[light]", "colour = [0.0, 0.0, 0.0]"]
    return "\n".join(lines)


def as_vector(values: Floats) -> Vector:
    """An array of three numbers as a vector of the scene model."""
    x, y, z = (float(value) for value in values)
    return x, y, z


def _list(values: Floats) -> str:
    return "[" + ", ".join(str(float(value)) for value in values) + "]"
