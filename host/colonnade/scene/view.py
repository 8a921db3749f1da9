"""The view: camera, lights and settings of a frame in mesh space, as floats.

The reference renderer uses it directly; `colonnade.registers.frame.frame_registers` rounds it to registers.
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
        reach: Distance of that intensity, mesh units; None for constant intensity.
    """

    position: Floats
    colour: Floats
    reach: float | None = None


@dataclass(frozen=True)
class View:
    """The view of one frame, in mesh space.

    The ray through the centre of pixel (x, y) is ``origin + t * (direction + x * step_x + y * step_y)``. Pixel (0, 0)
    is at the top left. Directions are not normalised: one unit of t is one mesh unit of depth.

    Attributes:
        width, height: Size of the frame, pixels.
        origin, direction, step_x, step_y: float64 [3].
        lights: At least one.
        materials: Indexed by the mesh's `face_materials`; at least one.
        ambient, background: float64 [3], linear.
        flat: Shade with geometric normals instead of smooth ones.
        shadows: Trace shadow rays.
        shadow_offset: Distance of secondary rays' origins from the surface, mesh units.
        shadow_transmittance: Fraction of light that a glass occluder transmits.
        bounces: Traced reflections and refractions of a path.
        view_to_mesh: Transform from a room's view space, metres, to mesh space, float64 [3, 4]; None without a room.
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
    """Make the view of a scene at its motion's progress.

    Cameras and lights that are relative to the object keep their positions from the start of the motion.

    Args:
        scene: What to render.
        extent: Bounds of the mesh (`Mesh.extent`, or that of an image's header).
        width: Width of the frame, pixels.
        height: Height of the frame, pixels.
        materials: Materials of the mesh; the scene's values override them.
        environment: The room of `scene.background`, whose camera is then used.
    """
    pose = object_pose(scene, extent, environment)
    start = object_pose(scene.at(0.0), extent, environment)
    if environment is not None:
        camera = environment_camera(environment, width, height)
    else:
        camera = scene_camera(scene.camera, start, extent, width, height)
    positions = [_world_position(light, camera, start, extent) for light in scene.lights]
    return View(
        width=width,
        height=height,
        origin=pose.to_mesh(camera.position),
        direction=camera.corner @ pose.rotation,
        step_x=camera.step_x @ pose.rotation,
        step_y=camera.step_y @ pose.rotation,
        lights=tuple(
            _placed(light, position, scene.headroom, pose)
            for light, position in zip(scene.lights, positions, strict=True)
        ),
        materials=_dimmed(with_overrides(materials, scene.material), scene.headroom),
        ambient=np.array(scene.ambient.colour) * scene.headroom,
        background=np.array(scene.background.colour),
        flat=scene.material.flat,
        shadows=scene.light.shadows,
        shadow_offset=scene.light.shadow_offset * extent.edge,
        shadow_transmittance=scene.paths.shadow_transmittance,
        bounces=scene.paths.bounces,
        view_to_mesh=None if environment is None else pose.from_view(environment.camera_to_world),
    )


def with_overrides(materials: Sequence[MeshMaterial], overrides: Material) -> tuple[MeshMaterial, ...]:
    """Replace values of a mesh's materials by those that the scene gives."""
    given = {key: value for key in ("kind", "albedo", "ior") if (value := getattr(overrides, key)) is not None}
    return tuple(replace(material, **given) for material in materials)


def world_positions(scene: Scene, extent: Extent, environment: Environment) -> list[Floats]:
    """World positions of a scene's lights in a room, float64 [3] each."""
    camera = environment_camera(environment, environment.width, environment.height)
    start = object_pose(scene.at(0.0), extent, environment)
    return [_world_position(light, camera, start, extent) for light in scene.lights]


def _world_position(light: PointLight, camera: WorldCamera, start: Pose, extent: Extent) -> Floats:
    """World position of a light; `start` is the object's pose at the start of the motion."""
    if light.position is not None:
        return np.array(light.position)
    return np.asarray(
        start.to_world(extent.centre) + extent.edge * start.scale * (np.array(light.offset) @ camera.axes)
    )


def _placed(light: PointLight, position: Floats, headroom: float, pose: Pose) -> PlacedLight:
    reach = None if light.falloff is None else light.falloff / pose.scale
    return PlacedLight(pose.to_mesh(position), np.array(light.colour) * headroom, reach)


def _dimmed(materials: tuple[MeshMaterial, ...], headroom: float) -> tuple[MeshMaterial, ...]:
    """The materials under lights that are brighter by ``headroom``: diffuse surfaces keep their colour."""

    def dimmed(material: MeshMaterial) -> MeshMaterial:
        if material.kind != "diffuse" or headroom == 1.0:
            return material
        red, green, blue = (value / headroom for value in material.albedo)
        return replace(material, albedo=(red, green, blue))

    return tuple(dimmed(material) for material in materials)
