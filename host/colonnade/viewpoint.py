"""Camera and light of a scene in the mesh's own space, in floats: what the reference renders and `placement` rounds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from colonnade.cameras import Camera, room_camera, scene_camera
from colonnade.mesh_materials import PLAIN, MeshMaterial
from colonnade.meshes import Extent
from colonnade.pose import Pose, object_pose
from colonnade.scene import Light, Material, Scene

if TYPE_CHECKING:
    from colonnade.room import Room

Floats = npt.NDArray[np.float64]


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
class FloatPlacement:
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


def float_placement(
    scene: Scene,
    extent: Extent,
    width: int,
    height: int,
    materials: tuple[MeshMaterial, ...] = (PLAIN,),
    room: Room | None = None,
) -> FloatPlacement:
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
    pose = object_pose(scene, extent, room)
    start = object_pose(scene.at(0.0), extent, room)
    centre, edge = start.to_world(extent.centre), extent.edge * start.scale
    if room is not None:
        camera = room_camera(room, width, height)
    else:
        camera = scene_camera(scene.camera, start, extent, width, height)
    return FloatPlacement(
        width=width,
        height=height,
        origin=pose.to_mesh(camera.position),
        direction=camera.corner @ pose.rotation,
        step_x=camera.step_x @ pose.rotation,
        step_y=camera.step_y @ pose.rotation,
        lights=tuple(_placed(light, camera, centre, edge, pose) for light in scene.lights),
        materials=made_of(materials, scene.material),
        ambient=np.array(scene.ambient.colour),
        background=np.array(scene.background.colour),
        flat=scene.material.flat,
        shadows=scene.light.shadows,
        shadow_offset=scene.light.shadow_offset * extent.edge,
        shadow_transmittance=scene.paths.shadow_transmittance,
        bounces=scene.paths.bounces,
        view_to_mesh=None if room is None else pose.from_view(room.camera_to_world),
    )


def made_of(own: Sequence[MeshMaterial], wanted: Material) -> tuple[MeshMaterial, ...]:
    """Materials of a mesh with what the scene says in their place."""
    given = {key: value for key in ("kind", "albedo", "ior") if (value := getattr(wanted, key)) is not None}
    return tuple(replace(material, **given) for material in own)


def _placed(light: Light, camera: Camera, centre: Floats, edge: float, pose: Pose) -> PlacedLight:
    if light.position is not None:
        position = np.array(light.position)
    else:
        position = centre + edge * (np.array(light.offset) @ camera.axes)
    reach = None if light.falloff is None else light.falloff / pose.scale
    return PlacedLight(pose.to_mesh(position), np.array(light.colour), reach)
