"""The view: camera, lights and settings of a frame in mesh space, as floats.

The reference renderer uses it directly; `colonnade.registers.frame.placed_registers` rounds it to registers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from colonnade.common.types import Floats
from colonnade.environment.light_cube import LightCube
from colonnade.mesh.materials.materials import MARKS, PLAIN, MeshMaterial, as_rendered, in_layer, in_pass, is_lit
from colonnade.scene.cameras import (
    WorldCamera,
    camera_axes,
    environment_camera,
    moved_camera,
    start_camera,
    through_lens,
)
from colonnade.scene.model import Material, PointLight, Scene
from colonnade.scene.object_pose import Placed, Pose

_UP = (0.0, 1.0, 0.0)


@dataclass(frozen=True)
class PlacedLight:
    """A point light, in mesh space or in world space.

    Attributes:
        position: float64 [3].
        colour: float64 [3], linear.
        reach: Distance of that intensity; None for constant intensity.
    """

    position: Floats
    colour: Floats
    reach: float | None = None


@dataclass(frozen=True)
class Gather:
    """Gathered rays of a frame (docs/gather.md).

    Attributes:
        bounces: Gathered rays of a path, one after the other.
        points: The frame's sample point of each of them, two bytes.
        cube: The light that they meet, by directions of mesh space; only the reference needs it.
    """

    bounces: int
    points: tuple[tuple[int, int], ...]
    cube: LightCube | None = None


@dataclass(frozen=True)
class View:
    """The view of one frame, in mesh space.

    The ray of pixel (x, y) is ``origin + t * (direction + x * step_x + y * step_y)``. Pixel (0, 0) is at the top left.
    Directions are not normalised: one unit of t is one mesh unit of depth.

    Attributes:
        width, height: Size of the frame, pixels.
        origin, direction, step_x, step_y: float64 [3].
        lights: At least one.
        materials: Indexed by the mesh's `face_materials`; at least one.
        ambient, background: float64 [3], linear.
        flat: Shade with geometric normals instead of smooth ones.
        shadows: Trace shadow rays.
        shadow_offset: Distance of the device's secondary rays' origins from the surface, mesh units. None: by its
            rounding. The reference has its own (`colonnade.reference.embree.RayTracer.offset`).
        shadow_transmittance: Fraction of light that a glass occluder transmits.
        bounces: Traced reflections and refractions of a path.
        view_to_mesh: Transform from a room's view space, metres, to mesh space, float64 [3, 4]; None without a room.
        shift: Where the rays cross the picture, from the pixels' centres: pixels right and down.
        occlusion: The room hides the object where it is nearer.
        is_map_camera: In a room: the camera took its maps.
        gather: Gathered rays; None: every surface has the ambient light.
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
    shadow_offset: float | None = None
    shadow_transmittance: float = 0.3
    bounces: int = 4
    view_to_mesh: Floats | None = None
    shift: tuple[float, float] = (0.0, 0.0)
    occlusion: bool = True
    is_map_camera: bool = True
    gather: Gather | None = None

    @property
    def light(self) -> Floats:
        """Position of the first light, float64 [3]."""
        return self.lights[0].position

    @property
    def albedo(self) -> Floats:
        """Albedo of the first material, float64 [3]."""
        return np.array(self.materials[0].albedo)


@dataclass(frozen=True)
class WorldView:
    """The view of one frame, in world space.

    Attributes:
        pose: The object's pose.
        camera: The camera; its corner is the sample's.
        lights: At least one; reach in world units.
    """

    pose: Pose
    camera: WorldCamera
    lights: tuple[PlacedLight, ...]


def world_view(placed: Placed, width: int, height: int) -> WorldView:
    """Object, camera and lights of a scene at its motion's progress and its sample.

    Cameras and lights that are relative to the object keep their positions from the start of the motion.
    Arguments are as in `make_view`.
    """
    scene, environment, pose = placed.scene, placed.room, placed.pose
    centre, edge = placed.start.to_world(placed.extent.centre), placed.extent.edge * placed.start.scale
    first = start_camera(placed, width, height)
    camera = moved_camera(placed, first, width, height)
    if scene.camera.aperture > 0:
        camera = through_lens(camera, scene.camera, centre, scene.sample.lens)
    # In a room, light does not depend on where the scene's camera stands
    axes = first.axes if environment is None else environment.camera_to_world[:, :3].T * [[1.0], [-1.0], [-1.0]]
    lights = tuple(
        _placed(scene, index, axes, centre, edge) for index in range(len(scene.lights)) if scene.light_share(index) > 0
    )
    shift_x, shift_y = scene.sample.pixel
    corner = camera.corner + shift_x * camera.step_x + shift_y * camera.step_y
    return WorldView(pose, replace(camera, corner=corner), lights)


def make_view(placed: Placed, width: int, height: int, materials: tuple[MeshMaterial, ...] = (PLAIN,)) -> View:
    """Make the view of a scene at its motion's progress and its sample.

    Args:
        placed: What to render. In a room its camera is used unless the scene places one.
        width: Width of the frame, pixels.
        height: Height of the frame, pixels.
        materials: Materials of the mesh; the scene's values override them.
    """
    scene, world = placed.scene, world_view(placed, width, height)
    pose, camera = world.pose, world.camera
    has_highlights = scene.sample.layer in MARKS
    gathers = scene.paths.gather > 0 and not has_highlights
    return View(
        width=width,
        height=height,
        origin=pose.to_mesh(camera.position),
        direction=camera.corner @ pose.rotation,
        step_x=camera.step_x @ pose.rotation,
        step_y=camera.step_y @ pose.rotation,
        lights=tuple(
            PlacedLight(
                pose.to_mesh(light.position), light.colour, None if light.reach is None else light.reach / pose.scale
            )
            for light in world.lights
        ),
        materials=_dimmed(
            tuple(
                in_layer(in_pass(one, scene.sample.coverage_of(entry)), scene.sample.layer)
                for entry, one in enumerate(rendered_materials(materials, scene))
            ),
            scene.headroom,
            scene.exposure,
        ),
        ambient=np.array(scene.ambient.colour) * (not has_highlights) * scene.headroom * scene.exposure,
        background=np.array(scene.background.colour) * scene.exposure,
        flat=scene.material.flat,
        shadows=scene.light.shadows,
        shadow_offset=None if scene.light.shadow_offset is None else scene.light.shadow_offset * placed.extent.edge,
        shadow_transmittance=scene.paths.shadow_transmittance,
        bounces=scene.paths.bounces,
        view_to_mesh=None if placed.room is None else pose.from_view(placed.room.camera_to_world),
        shift=scene.sample.pixel,
        occlusion=scene.background.occlusion,
        is_map_camera=not scene.places_camera,
        gather=Gather(scene.paths.gather, scene.sample.gather) if gathers else None,
    )


def with_overrides(materials: Sequence[MeshMaterial], overrides: Material) -> tuple[MeshMaterial, ...]:
    """Replace values of a mesh's materials by the scene's.

    An albedo replaces corner colours and textures too, another kind the roughness, coverage and clear coat.
    """
    given = {
        key: value for key in ("kind", "albedo", "ior", "roughness") if (value := getattr(overrides, key)) is not None
    }
    if "albedo" in given:
        given |= {"has_corner_colours": False, "texture": None}
    other: dict[str, Any] = {"roughness": 0.0, "coverage": 1.0, "clear_coat": PLAIN.clear_coat}
    return tuple(
        replace(material, **({} if material.kind == given.get("kind", material.kind) else other) | given)
        for material in materials
    )


def rendered_materials(materials: Sequence[MeshMaterial], scene: Scene) -> tuple[MeshMaterial, ...]:
    """A mesh's materials with the values that the scene gives, as the device shows them (`as_rendered`)."""
    return tuple(as_rendered(one, scene.paths.gather > 0) for one in with_overrides(materials, scene.material))


def world_positions(placed: Placed) -> list[Floats]:
    """World positions of a scene's lights, float64 [3] each; of a light with a radius its middle."""
    room, start, extent = placed.room, placed.start, placed.extent
    camera = start_camera(placed, 1, 1) if room is None else environment_camera(room, room.width, room.height)
    centre, edge = start.to_world(extent.centre), extent.edge * start.scale
    return [_world_position(light, camera.axes, centre, edge) for light in placed.scene.lights]


def _world_position(light: PointLight, axes: Floats, centre: Floats, edge: float) -> Floats:
    if light.position is not None:
        return np.array(light.position)
    return np.asarray(centre + edge * (np.array(light.offset) @ axes))


def _placed(scene: Scene, index: int, axes: Floats, centre: Floats, edge: float) -> PlacedLight:
    """A light of a scene in world space, in the device's numbers.

    Of one with a radius it is the sample's point of a disc that faces `centre`. In highlights it is without what its
    mark shows (docs/gather.md); fitted lights have no mark.
    """
    light = scene.lights[index]
    position = _world_position(light, axes, centre, edge)
    colour = np.array(light.colour) * scene.headroom * scene.exposure * scene.light_share(index)
    if light.radius > 0:
        away, on_disc = position - centre, scene.sample.light(index)
        if scene.sample.layer in MARKS and not scene.fits_lights:
            of_mark = MARKS[scene.sample.layer] * light.radius**2 / (light.falloff**2 if light.falloff else away @ away)
            of_mark *= scene.light_share(index)
            colour = (colour - scene.headroom * of_mark).clip(min=0.0)
        right, up, _ = camera_axes(away if away.any() else axes[2], _UP)
        position = position + light.radius * (on_disc[0] * right + on_disc[1] * up)
    return PlacedLight(position, colour, light.falloff)


def _dimmed(materials: tuple[MeshMaterial, ...], headroom: float, exposure: float) -> tuple[MeshMaterial, ...]:
    """The materials under lights that are brighter by ``headroom``: surfaces that these light keep their colour."""

    def dimmed(material: MeshMaterial) -> MeshMaterial:
        red, green, blue = (value * exposure for value in material.emission)
        material = replace(material, emission=(red, green, blue))
        if not is_lit(material) or headroom == 1.0:
            return material
        red, green, blue = (value / headroom for value in material.albedo)
        return replace(material, albedo=(red, green, blue))

    return tuple(dimmed(material) for material in materials)
