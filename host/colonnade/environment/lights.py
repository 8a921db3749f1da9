"""Lights of a room in world space, and the device's light rules without shadows (docs/shading.md)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from colonnade.common import fixed_order
from colonnade.common.types import Floats
from colonnade.environment.model import Environment

#: Upper limit of a light's distance falloff, reached at half its reference distance.
MAX_FALLOFF = 4.0
#: Distance between lights and the box of what the camera sees, metres, at most; the camera is part of the box.
_MARGIN = np.array([1.0, 0.5, 1.5])
#: Height of a light above the lowest thing in view, metres, at least.
MIN_HEIGHT = 0.3


@dataclass(frozen=True)
class RoomLight:
    """A point light.

    Attributes:
        position: World space, metres, float64 [3].
        colour: Linear intensity, float64 [3].
        falloff: Distance of that intensity, metres; None for constant intensity.
        radius: Of a light with an area, metres; 0: a point.
    """

    position: Floats
    colour: Floats
    falloff: float | None
    radius: float = 0.0


@dataclass(frozen=True)
class RoomLights:
    """Ambient light, linear, float64 [3], and point lights."""

    ambient: Floats
    lights: tuple[RoomLight, ...] = ()

    def brighter(self, factor: float) -> RoomLights:
        """The lights with intensities times a factor."""
        lights = tuple(replace(light, colour=light.colour * factor) for light in self.lights)
        return RoomLights(self.ambient * factor, lights)


def irradiance(points: Floats, normals: Floats, lights: RoomLights) -> Floats:
    """Irradiance of unshadowed surfaces, float64 [..., 3].

    Args:
        points: World space, metres, float64 [..., 3].
        normals: Unit, world space, float64 [..., 3].
        lights: The lights.
    """
    total = np.broadcast_to(lights.ambient, points.shape).astype(np.float64)
    for light in lights.lights:
        total = total + light.colour * exposure(points, normals, light.position, light.falloff)[..., None]
    return total


def exposure(points: Floats, normals: Floats, position: Floats, falloff: float | None) -> Floats:
    """Irradiance of unshadowed surfaces by a point light of intensity 1, float64 [...].

    Args:
        points: World space, metres, float64 [..., 3].
        normals: Unit, world space, float64 [..., 3].
        position: Of the light, float64 [3].
        falloff: Distance of that intensity, metres; None for constant intensity.
    """
    to_light = position - points
    squared = fixed_order.dot(to_light, to_light).clip(min=1e-12)
    cosine = fixed_order.dot(normals, to_light).clip(min=0.0) / np.sqrt(squared)
    if falloff is None:
        return np.asarray(cosine)
    return np.asarray(cosine * np.minimum(falloff**2 / squared, MAX_FALLOFF))


def room_box(environment: Environment) -> tuple[Floats, Floats]:
    """The corners of the box around a room, world space, float64 [3] each: what the camera sees, and around.

    Its lowest level is the floor's.
    """
    points, eye = world_surface(environment)[0].reshape(-1, 3), environment.camera_to_world[:, 3]
    low = np.minimum(np.percentile(points, 2, axis=0), eye) - _MARGIN
    high = np.maximum(np.percentile(points, 98, axis=0), eye) + _MARGIN
    low[1] = np.percentile(points[:, 1], 2)
    return low, high


def light_box(environment: Environment) -> tuple[Floats, Floats]:
    """The corners of the box that may hold lights, world space, float64 [3] each: the room's, above its floor."""
    low, high = room_box(environment)
    low[1] += MIN_HEIGHT
    return low, high


def world_surface(environment: Environment) -> tuple[Floats, Floats]:
    """Points and unit normals of the room's pixels in world space, float64 [height, width, 3] each."""
    rotation, eye = environment.camera_to_world[:, :3], environment.camera_to_world[:, 3]
    turned = rotation.T
    return (
        fixed_order.product(environment.points(), turned) + eye,
        fixed_order.product(environment.normals, turned),
    )
