"""Camera and lights of a scene in the mesh's own space, in floats.

The reference renders this view; `colonnade.registers.frame.frame_registers` rounds it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from colonnade.common.types import Floats
from colonnade.mesh.materials import PLAIN, MeshMaterial
from colonnade.mesh.mesh import Extent
from colonnade.scene.cameras import WorldCamera, environment_camera, scene_camera
from colonnade.scene.model import Material, PointLight, Scene
from colonnade.scene.object_pose import Pose, object_pose

if TYPE_CHECKING:
    from colonnade.environment.model import Environment


@dataclass(frozen=True)
class PlacedLight:
    """A point light in mesh space.

    Attributes:
        position: float64 [3].
        colour: float64 [3], linear.
        reach: Distance at which it has that colour, mesh units; None where it is equally bright everywhere.
    """

    position: Floats
    colour: Floats
    reach: float | None = None


@dataclass(frozen=True)
class View:
    """A frame in mesh space.

    The ray of pixel (x, y), (0, 0) at the top left, is ``origin + t * (direction + x * step_x + y * step_y)``; it goes
    through the pixel's centre. Directions are not normalised: one unit of t is one mesh unit of depth.

    Attributes:
        width, height: Pixels.
        origin, direction, step_x, step_y: float64 [3].
        lights: At least one.
        materials: Of the mesh's `face_materials`, at least one.
        ambient, background: float64 [3], linear.
        flat: Shade with geometric normals.
        shadows: Trace shadow rays.
        shadow_offset: How far off the surface secondary rays start, mesh units.
        shadow_transmittance: What glass lets through of a light.
        bounces: Reflections and refractions of a path that are traced.
        view_to_mesh: float64 [3, 4] from a room's view space, metres, to mesh space; None without a room.
    """

    width: int
    height: int
    origin: Floats
    direction: Floats
    step_x: Floats
    step_y: Floats
    lights: tuple[PlacedLight, ...]
    materials: tuple[MeshMaterial, ...]
    ambient: Floats
    background: Floats
    flat: bool
    shadows: bool
    shadow_offset: float
    shadow_transmittance: float = 0.6
    bounces: int = 4
    view_to_mesh: Floats | None = None

    @property
    def light(self) -> Floats:
        """Position of the first light, float64 [3]."""
        return self.lights[0].position

    @property
    def light_colour(self) -> Floats:
        """Colour of the first light, float64 [3]."""
        return self.lights[0].colour

    @property
    def albedo(self) -> Floats:
        """Albedo of the first material, float64 [3]."""
        return np.array(self.materials[0].albedo)


def make_view(
    scene: Scene,
    extent: Extent,
    width: int,
    height: int,
    materials: tuple[MeshMaterial, ...] = (PLAIN,),
    environment: Environment | None = None,
) -> View:
    """The frame of a scene. What is placed relative to the object, the camera or lights, stays where it is at the
    beginning of the scene's motion.

    Args:
        scene: What to render.
        extent: Of its mesh (`Mesh.extent`, or that of an image's header).
        width: Pixels.
        height: Pixels.
        materials: Of the mesh; what the scene says takes their place.
        room: The one that `scene.background` names; then its camera sees the frame.
    """
    pose = object_pose(scene, extent, environment)
    start = object_pose(scene.at(0.0), extent, environment)
    centre, edge = start.to_world(extent.centre), extent.edge * start.scale
    if environment is not None:
        camera = environment_camera(environment, width, height)
    else:
        camera = scene_camera(scene.camera, start, extent, width, height)
    return View(
        width=width,
        height=height,
        origin=pose.to_mesh(camera.position),
        direction=camera.corner @ pose.rotation,
        step_x=camera.step_x @ pose.rotation,
        step_y=camera.step_y @ pose.rotation,
        lights=tuple(_placed(light, camera, centre, edge, pose) for light in scene.lights),
        materials=with_overrides(materials, scene.material),
        ambient=np.array(scene.ambient.colour),
        background=np.array(scene.background.colour),
        flat=scene.material.flat,
        shadows=scene.light.shadows,
        shadow_offset=scene.light.shadow_offset * extent.edge,
        shadow_transmittance=scene.paths.shadow_transmittance,
        bounces=scene.paths.bounces,
        view_to_mesh=None if environment is None else pose.from_view(environment.camera_to_world),
    )


def with_overrides(own: Sequence[MeshMaterial], wanted: Material) -> tuple[MeshMaterial, ...]:
    """Materials of a mesh with what the scene says in their place."""
    given = {key: value for key in ("kind", "albedo", "ior") if (value := getattr(wanted, key)) is not None}
    return tuple(replace(material, **given) for material in own)


def _placed(light: PointLight, camera: WorldCamera, centre: Floats, edge: float, pose: Pose) -> PlacedLight:
    if light.position is not None:
        position = np.array(light.position)
    else:
        position = centre + edge * (np.array(light.offset) @ camera.axes)
    reach = None if light.falloff is None else light.falloff / pose.scale
    return PlacedLight(pose.to_mesh(position), np.array(light.colour), reach)
