"""The scene: its tables, and what it knows of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field, replace
from pathlib import Path
from typing import Annotated

from pydantic import InstanceOf, WithJsonSchema
from pydantic.dataclasses import dataclass

from colonnade.common.errors import UserError
from colonnade.environment.model import EnvironmentCamera
from colonnade.scene.model.camera import Camera, FrameSize, Motion
from colonnade.scene.model.light import Background, Colour, Light, Paths, PointLight
from colonnade.scene.model.objects import Material, MeshSource, Placement, SceneObject, Transform
from colonnade.scene.model.values import STRICT, Vector
from colonnade.scene.samples import CENTRE, Sample


@dataclass(frozen=True, config=STRICT)
class Scene:
    """One object or several, one camera, at least one light.

    With a room, the camera is the room's unless the scene places it, and the world is the room's world, in metres.

    Not in scene files: ``motion_progress`` is the progress along the motion, 0.0 to 1.0. ``sample`` is one pass's
    over the frame. ``standing_points`` are the world points on which the object stands at the ends of the motion, if
    they are known from another view of its room. ``frame_camera`` is the camera of a sequence's frame with the maps of
    another frame: a lens for their size, and a pose. ``names_light`` tells whether the scene names lights or ambient
    light; if not, lights of a room are fitted to its photo. ``names_gather`` tells whether it says how many rays a path
    gathers. ``fits_lights`` tells that these have an area, a guess that no mirror shows. ``pass_lights`` is the number
    of lights of a pass, if those were found and may be more; 0: it has all. ``headroom`` scales all lights
    up and diffuse albedos of the object down (`colonnade.environment.photo_colours`). ``exposure`` is the device's
    number for the radiance 1.0, as a factor. ``note`` tells what the scene of a mesh file assumes.
    """

    mesh: MeshSource
    transform: Transform = field(default_factory=Transform)
    camera: Camera = field(default_factory=Camera)
    light: Light = field(default_factory=Light)
    more_lights: tuple[PointLight, ...] = ()
    material: Material = field(default_factory=Material)
    ambient: Colour = field(default_factory=lambda: Colour((0.1, 0.1, 0.1)))
    background: Background = field(default_factory=Background)
    placement: Placement | None = None  # in a room without a [transform]: the default one
    objects: tuple[SceneObject, ...] = ()  # in place of mesh, transform, material and placement, which are unused then
    paths: Paths = field(default_factory=Paths)
    frame: FrameSize = field(default_factory=FrameSize)
    motion: Motion = field(default_factory=Motion)
    motion_progress: float = 0.0
    sample: Sample = CENTRE
    standing_points: tuple[Vector, Vector] | None = None
    frame_camera: Annotated[InstanceOf[EnvironmentCamera], WithJsonSchema({})] | None = None
    names_light: bool = True
    names_gather: bool = True
    fits_lights: bool = False
    pass_lights: int = 0
    headroom: float = 1.0
    exposure: float = 1.0
    note: str = ""

    def at(self, progress: float) -> Scene:
        """The scene at a progress along its motion."""
        return replace(self, motion_progress=progress)

    def with_samples(self, samples: int) -> Scene:
        """The scene with so many samples a pixel."""
        return replace(self, frame=replace(self.frame, samples=samples))

    @property
    def blurs(self) -> list[str]:
        """The keys that only several samples show."""
        keys = {
            "light.radius": not self.fits_lights and any(light.radius > 0 for light in self.lights),
            "camera.aperture": self.camera.aperture > 0,
            "motion.shutter": self.motion.shutter > 0,
        }
        return [key for key, is_used in keys.items() if is_used]

    def with_mesh(self, name_or_path: str) -> Scene:
        """The scene with another mesh, a name or a path relative to the working directory.

        Raises:
            UserError: The scene has several objects.
        """
        self.require_one_object("a mesh replaces that of a single object")
        return replace(self, mesh=replace(self.mesh, name=name_or_path, path=None), note="")

    def with_simplified_mesh(self, triangles: int) -> Scene:
        """The scene with its mesh simplified to so many triangles.

        Raises:
            UserError: The scene has several objects, or an animation.
        """
        if self.mesh.animation is not None:
            raise UserError("mesh.animation moves all triangles: leave out --simplify")
        self.require_one_object("--simplify is of a single object, simplify in the mesh of each [[object]] of its own")
        return replace(self, mesh=replace(self.mesh, simplify=triangles))

    def with_environment(self, folder: Path) -> Scene:
        """The scene in the room of a folder."""
        return replace(self, background=replace(self.background, room=folder))

    @property
    def has_animation(self) -> bool:
        """Whether a mesh has an animation."""
        return any(mesh.animation is not None for mesh in (self.mesh, *(one.mesh for one in self.objects)))

    @property
    def is_animated(self) -> bool:
        """Whether a mesh has an animation, or an object a motion of its own."""
        return self.has_animation or any(one.motion for one in self.objects)

    @property
    def is_still(self) -> bool:
        """Whether nothing moves."""
        return self.motion.is_still and not self.is_animated

    def frame_progress(self, frames: int) -> list[float]:
        """Progress of each frame along the motion, evenly spaced from 0.0 to 1.0.

        A closed motion leaves out 1.0, so that an animation repeats without a pause.
        """
        return [frame / self._intervals(frames) for frame in range(frames)]

    def opening(self, frames: int) -> float:
        """Progress while the shutter is open for one of `frames` frames. A single frame's interval is the motion."""
        return self.motion.shutter / self._intervals(frames)

    def _intervals(self, frames: int) -> int:
        is_closed = self.motion.is_closed and all(one.returns for one in self.objects)
        return max(frames if is_closed else frames - 1, 1)

    @property
    def places_camera(self) -> bool:
        """Whether the camera may be elsewhere than the room's maps' camera."""
        return self.frame_camera is not None or self.camera.position is not None or bool(self.motion.camera)

    @property
    def lights(self) -> tuple[PointLight, ...]:
        """All lights; the motion moves the first one."""
        first, end = self.light, self.motion.light
        if first.position is not None and end is not None:
            first = replace(first, position=interpolate(first.position, end, self.motion_progress))
        return first, *self.more_lights

    def light_share(self, index: int) -> float:
        """Factor of a light in the pass of `sample`; 0: the pass has not got it."""
        if self.sample.shares:
            return self.sample.shares[index]
        return float(self.pass_lights == 0 or index < self.pass_lights)

    @property
    def mesh_source(self) -> str | Path:
        """The argument for `colonnade.mesh.load.load_mesh`, of a scene of one object.

        Raises:
            UserError: The scene has several objects.
        """
        self.require_one_object("this command is for a scene of one object")
        return self.mesh.source

    def require_one_object(self, reason: str) -> None:
        """Refuse a scene with ``[[object]]`` tables.

        Raises:
            UserError: The message begins with the reason.
        """
        if self.objects:
            raise UserError(f"{reason}, but the scene has {len(self.objects)} [[object]]: use [mesh] and [object]")


def interpolate(start: Sequence[float], end: Sequence[float], fraction: float) -> Vector:
    """Interpolate two points linearly; both ends are exact."""
    x, y, z = ((1.0 - fraction) * a + fraction * b for a, b in zip(start, end, strict=True))
    return x, y, z
