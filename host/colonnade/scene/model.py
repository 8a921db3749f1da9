"""The scene model, which is also the schema of the scene file: its keys, ranges and defaults.

Colours and intensities are linear. Lengths are in world units, which are the mesh's units unless ``[transform]`` scales
them. Values are checked when a scene is constructed, from a file or in code; unknown keys are refused.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import field, replace
from pathlib import Path
from typing import Annotated, Literal

from annotated_types import Ge, Interval
from pydantic import BeforeValidator, ConfigDict, Field, InstanceOf, Strict, StrictBool, WithJsonSchema, model_validator
from pydantic.dataclasses import dataclass
from typing_extensions import Self

from colonnade.common.errors import UserError
from colonnade.common.limits import MAX_COORDINATE, MAX_SAMPLES
from colonnade.environment.model import EnvironmentCamera
from colonnade.mesh.materials import Kind, MeshMaterial, as_rendered
from colonnade.scene.samples import CENTRE, MAX_GATHERED, Sample, samples_of_frame

_STRICT = ConfigDict(extra="forbid")

#: Largest width or height of a room's maps, pixels.
MAX_EDGE = 4096
#: The most objects of a scene.
MAX_OBJECTS = 64
#: The most bounces that any configuration supports.
MAX_BOUNCES = 15


def _require_text(value: object) -> object:
    if not isinstance(value, str | Path) or not str(value):
        raise ValueError("must be text")
    return value


# Numbers are strict: text and Booleans are not converted.
_Float = Annotated[float, Strict()]
_Coordinate = Annotated[_Float, Interval(ge=-MAX_COORDINATE, le=MAX_COORDINATE)]
_Fraction = Annotated[_Float, Interval(ge=0.0, le=1.0)]
_Diameter = Annotated[_Float, Interval(ge=0.0, le=1e6)]
_Intensity = Annotated[_Float, Interval(ge=0.0, le=15.0)]
_MapPixel = Annotated[_Float, Interval(ge=0.0, le=MAX_EDGE)]
_Text = Annotated[str, Field(min_length=1)]
_File = Annotated[Path, BeforeValidator(_require_text)]

Vector = tuple[float, float, float]
_Vector = tuple[_Coordinate, _Coordinate, _Coordinate]
_Colour = tuple[_Fraction, _Fraction, _Fraction]
_BrightColour = tuple[_Intensity, _Intensity, _Intensity]
_Pixel = tuple[_MapPixel, _MapPixel]


@dataclass(frozen=True, config=_STRICT)
class MeshSource:
    """The mesh: a name (see `colonnade.mesh.load.load_mesh`), or a file relative to the scene file.

    Attributes:
        name, path: One of them.
        crease: Angle up to which edges are smooth, degrees, in place of the file's normals. None: the file's normals,
            without them 60 degrees.
    """

    name: _Text | None = None
    path: _File | None = None
    crease: Annotated[_Float, Interval(ge=0.0, le=180.0)] | None = None

    @model_validator(mode="after")
    def _exactly_one(self) -> Self:
        if (self.name is None) == (self.path is None):
            raise ValueError("[mesh] needs either a name or a path")
        return self

    @property
    def source(self) -> str | Path:
        """The argument for `colonnade.mesh.load.load_mesh`."""
        if self.path is not None:
            return self.path
        assert self.name is not None
        return self.name


@dataclass(frozen=True, config=_STRICT)
class Transform:
    """World = rotate · scale · mesh + translate; ``rotate`` is in degrees about x, then y, then z."""

    rotate: _Vector = (0.0, 0.0, 0.0)
    scale: Annotated[_Float, Interval(ge=1e-9, le=1e9)] = 1.0
    translate: _Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True, config=_STRICT)
class Camera:
    """A camera at a position, or framing the object from a direction.

    Attributes:
        position: World position; None for a framing camera.
        target: World point at the picture's centre; None is the centre of the object's cube.
        direction: From the centre of the object's cube towards a framing camera.
        framing: Fraction of the picture's height that the object's outline covers; less if its width would not fit.
        up: Up direction.
        fov: Vertical field of view, degrees; None: 40, in a room the lens of its maps.
        aperture: Diameter of the lens, world units; 0: a pinhole, everything is in focus.
        focus: Distance of the plane in focus along the view, world units; None: the plane through the target, or
            through the centre of the object's cube.
        grain: In a photo the object has the grain and the blur of its camera.
    """

    position: _Vector | None = None
    target: _Vector | None = None
    direction: _Vector = (0.45, 0.35, 1.0)
    framing: Annotated[_Float, Interval(ge=0.01, le=4.0)] = 0.7
    up: _Vector = (0.0, 1.0, 0.0)
    fov: Annotated[_Float, Interval(ge=1.0, le=150.0)] | None = None
    aperture: _Diameter = 0.0
    focus: Annotated[_Float, Interval(ge=1e-6, le=1e9)] | None = None
    grain: StrictBool = True

    @model_validator(mode="after")
    def _has_axes(self) -> Self:
        if self.target is not None and self.position is None:
            raise ValueError("camera.target needs camera.position")
        if self.focus is not None and self.aperture == 0.0:
            raise ValueError("camera.focus needs camera.aperture: a pinhole has everything in focus")
        for name, value in (("up", self.up), ("direction", self.direction)):
            if not any(value):
                raise ValueError(f"camera.{name} must not be zero")
        return self


@dataclass(frozen=True, config=_STRICT)
class CameraKey:
    """A camera's place at a moment of the motion: a table ``[[motion.camera]]``.

    Attributes:
        at: Progress of the motion.
        position: World position.
        target: World point at the picture's centre; None: that of the key before, or of the start.
    """

    position: _Vector = field(kw_only=True)
    target: _Vector | None = None
    at: _Fraction = 1.0


@dataclass(frozen=True, config=_STRICT)
class PointLight:
    """A point light, at a position or relative to camera and object.

    Attributes:
        position: World position; None for a relative light.
        offset: From the centre of the object's cube, in edges of the cube: right, up, towards the camera.
        colour: Intensity per channel; at 1 a surface that faces the light has its albedo as colour.
        falloff: Distance of that intensity, world units. The intensity falls with the squared distance, up to four
            times brighter when nearer. None: constant intensity.
        radius: Radius of a light with an area, world units; 0: a point.
    """

    position: _Vector | None = None
    offset: _Vector = (1.2, 1.6, 1.5)
    colour: _BrightColour = (0.9, 0.9, 0.9)
    falloff: Annotated[_Float, Interval(ge=1e-6, le=1e6)] | None = None
    radius: _Diameter = 0.0


@dataclass(frozen=True, config=_STRICT)
class Light(PointLight):
    """The first light, with the settings of all lights.

    Attributes:
        shadows: Whether lights cast shadows.
        shadow_offset: Distance of the device's secondary rays' origins from the surface, in edges of the object's
            cube. None: the least one that its rounding allows (`colonnade.registers.surface_offset`).
    """

    shadows: StrictBool = True
    shadow_offset: Annotated[_Float, Interval(ge=0.0, le=0.25)] | None = None


@dataclass(frozen=True, config=_STRICT)
class Material:
    """Overrides of the mesh's materials; None keeps the mesh's value.

    Attributes:
        kind: diffuse, mirror or glass.
        albedo: Diffuse reflectance, or tint of reflected or refracted light.
        ior: Index of refraction of glass.
        roughness: Of a mirror, or of the coat of a diffuse surface, 0 to 1.
        flat: Use geometric normals instead of smooth ones.
    """

    kind: Kind | None = None
    albedo: _Colour | None = None
    ior: Annotated[_Float, Interval(ge=1.0, le=4.0)] | None = None
    roughness: Annotated[_Float, Interval(ge=0.0, le=1.0)] | None = None
    flat: StrictBool = False

    @model_validator(mode="after")
    def _values_are_of_the_kind(self) -> Self:
        if self.ior is not None and self.kind not in (None, "glass"):
            raise ValueError(f"material.ior is for glass, not for a {self.kind} material")
        if self.roughness is not None and self.kind == "glass":
            raise ValueError("material.roughness is for mirrors and diffuse surfaces, not for a glass material")
        return self


@dataclass(frozen=True, config=_STRICT)
class Placement:
    """The object's place in a room, instead of scale and translation: the file's table ``[object]``.

    Attributes:
        stand_at: Pixel (u, v) of the room's maps; the object stands on its surface point, with the world's y up. None:
            on a level surface in view that has room for it (`colonnade.scene.standing.free_place`).
        size: Longest edge of the mesh's bounding box, metres.
        turn: Rotation about the vertical, degrees, after the transform's rotation.
    """

    stand_at: _Pixel | None = None
    size: Annotated[_Float, Interval(ge=1e-3, le=1e3)] = 0.3
    turn: Annotated[_Float, Interval(ge=-360.0, le=360.0)] = 0.0


@dataclass(frozen=True, config=_STRICT)
class SceneObject(Placement):
    """One of several objects: a table ``[[object]]``. In a room it stands, unless its transform scales or moves it.

    Attributes:
        mesh: Its mesh.
        transform: Its pose in the world; if it stands, only the rotation.
        material: Overrides of its mesh's materials.
    """

    mesh: MeshSource = field(kw_only=True)
    transform: Transform = field(default_factory=Transform, kw_only=True)
    material: Material = field(default_factory=Material, kw_only=True)

    @property
    def stands(self) -> bool:
        """Whether a room places it."""
        return self.transform.scale == 1.0 and not any(self.transform.translate)


@dataclass(frozen=True, config=_STRICT)
class Motion:
    """The motion of the object, or of all as one, and of the first light over a sequence of frames, from the scene on.

    Attributes:
        turn: Rotation of the object about the vertical through its centre, degrees.
        stand_at: Last value of ``object.stand_at``; the object moves straight to that surface point.
        translate: Last value of ``transform.translate``, for an object that does not stand in a room; of several
            objects, the shift of all.
        light: Last world position of the first light.
        camera: Places of the camera by ascending progress; straight ways in between, from the scene's camera on.
        shutter: How long each frame is exposed, as a fraction of the interval to the next one.
    """

    turn: Annotated[_Float, Interval(ge=-36000.0, le=36000.0)] = 360.0
    stand_at: _Pixel | None = None
    translate: _Vector | None = None
    light: _Vector | None = None
    camera: tuple[CameraKey, ...] = ()
    shutter: _Fraction = 0.0

    @model_validator(mode="after")
    def _ascends(self) -> Self:
        times = [key.at for key in self.camera]
        if sorted(set(times)) != times:
            raise ValueError("motion.camera.at must ascend from key to key")
        return self

    @property
    def is_still(self) -> bool:
        """Whether nothing moves."""
        return self.is_closed and self.turn == 0.0

    @property
    def is_closed(self) -> bool:
        """Whether the last state equals the first."""
        still = self.stand_at is None and self.translate is None and self.light is None and not self.camera
        return self.turn % 360.0 == 0.0 and still

    def frame_progress(self, frames: int) -> list[float]:
        """Progress of each frame along the motion, evenly spaced from 0.0 to 1.0.

        A closed motion leaves out 1.0, so that an animation repeats without a pause.
        """
        return [frame / self._intervals(frames) for frame in range(frames)]

    def exposure(self, frames: int) -> float:
        """Progress during the exposure of one of `frames` frames. A single frame's interval is the whole motion."""
        return self.shutter / self._intervals(frames)

    def _intervals(self, frames: int) -> int:
        return max(frames if self.is_closed else frames - 1, 1)


@dataclass(frozen=True, config=_STRICT)
class Paths:
    """Settings of paths over mirrors and glass.

    Attributes:
        bounces: Traced reflections and refractions of a path; the ray after them sees the background only.
        shadow_transmittance: Fraction of light that a glass occluder transmits.
        gather: Rays that a path gathers at diffuse surfaces of the object, one after the other, each with the light
            that it meets; 0: every surface has the ambient light.
    """

    bounces: Annotated[int, Strict(), Interval(ge=0, le=MAX_BOUNCES)] = 4
    shadow_transmittance: _Fraction = 0.6
    gather: Annotated[int, Strict(), Interval(ge=0, le=MAX_GATHERED)] = 0


@dataclass(frozen=True, config=_STRICT)
class Colour:
    """A linear colour; as ambient light it may be brighter than 1."""

    colour: _BrightColour = (0.0, 0.0, 0.0)


@dataclass(frozen=True, config=_STRICT)
class Background:
    """What rays see that miss the object: a room or one colour.

    Attributes:
        colour: Linear.
        room: The folder of a room, relative to the scene file.
        photo: In a room whose camera the scene places: the picture that this camera took, relative to the scene file.
            None: the room is drawn from its maps.
        occlusion: The room hides the object where it is nearer.
        second_view: The folder of another view of the room, in the same world, relative to the scene file: its photo is
            light around the object.
        panorama: An equirectangular picture of the light around the object, relative to the scene file: that of the
            directions that no photo shows.
        panorama_yaw: Rotation of the panorama about the world's y, degrees, as an object's turn; at 0 its middle looks
            along -z.
        panorama_exposure: Factor of its radiance. None: in a room with a photo, fitted where both show something; 1
            elsewhere.
        shadows: The object's shadow in a room's photo: ``photo``, none where the photo has a shadow of the room, or
            ``whole``. None: ``photo`` for lights that the scene does not name, if the room has an albedo map.
        colours: Colours of the room in reflections and refractions: ``photo``, those of its photo, or ``albedo``, its
            albedo under the scene's lights. None: ``photo`` in a frame that shows the photo, else ``albedo``.
    """

    colour: _Colour = (0.0, 0.0, 0.0)
    room: _File | None = None
    photo: _File | None = None
    occlusion: StrictBool = True
    second_view: _File | None = None
    panorama: _File | None = None
    panorama_yaw: Annotated[_Float, Interval(ge=-360.0, le=360.0)] = 0.0
    panorama_exposure: Annotated[_Float, Interval(ge=1e-6, le=1e6)] | None = None
    shadows: Literal["photo", "whole"] | None = None
    colours: Literal["photo", "albedo"] | None = None


@dataclass(frozen=True, config=_STRICT)
class FrameSize:
    """Default size of the frame, pixels, and the samples of each pixel.

    Attributes:
        samples: None: `colonnade.render.samples` chooses.
        budget: Seconds of the device at 200 MHz for a frame that gathers light and names no samples. None: a thirtieth.
        denoise: The noise of gathered light is filtered, in frames of the model and the RTL.
    """

    width: Annotated[int, Strict(), Ge(1)] = 640
    height: Annotated[int, Strict(), Ge(1)] = 480
    samples: Annotated[int, Strict(), Interval(ge=1, le=MAX_SAMPLES)] | None = None
    budget: Annotated[_Float, Interval(ge=1e-6, le=1e3)] | None = None
    denoise: bool = False


@dataclass(frozen=True, config=_STRICT)
class Scene:
    """One object or several, one camera, at least one light.

    With a room, the camera is the room's unless the scene places it, and the world is the room's world, in metres.

    Not in scene files: ``motion_progress`` is the progress along the motion, 0.0 to 1.0. ``sample`` is that of one pass
    over the frame. ``standing_point`` is the world point on which the object stands, if that is known from another view
    of its room. ``frame_camera`` is that of a sequence's frame with the maps of another frame: a lens for their size,
    and a pose. ``names_light`` tells whether the scene names lights or ambient light; if not, those of a room are
    fitted to its photo. ``headroom`` scales all lights up and diffuse albedos of the object down
    (`colonnade.environment.photo_colours`). ``exposure`` is the device's number for the radiance 1.0, as a factor.
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
    standing_point: Vector | None = None
    frame_camera: Annotated[InstanceOf[EnvironmentCamera], WithJsonSchema({})] | None = None
    names_light: bool = True
    headroom: float = 1.0
    exposure: float = 1.0

    def at(self, progress: float) -> Scene:
        """The scene at a progress along its motion."""
        return replace(self, motion_progress=progress)

    def with_samples(self, samples: int) -> Scene:
        """The scene with so many samples a pixel."""
        return replace(self, frame=replace(self.frame, samples=samples))

    def passes(self, exposure: float = 0.0) -> list[Scene]:
        """The scene at each sample of its frame.

        Args:
            exposure: Progress of the motion while the shutter is open (`Motion.exposure`).
        """
        return self._passes(samples_of_frame(self.frame.samples or 1, len(self.lights)), exposure)

    def coat_passes(self, materials: Iterable[MeshMaterial], exposure: float = 0.0) -> list[Scene]:
        """The scene at the samples that show the coats of surfaces alone, a quarter of its samples; [] without coats.

        Args:
            materials: Of the mesh, with the scene's overrides.
            exposure: As in `passes`.
        """
        rendered = (as_rendered(one, gathers=True) for one in materials)
        if not self.has_coats or not any(one.kind == "diffuse" and one.roughness > 0 for one in rendered):
            return []
        samples = samples_of_frame(max(1, (self.frame.samples or 1) // 4), len(self.lights))
        return self._passes([replace(sample, is_coat=True) for sample in samples], exposure)

    def _passes(self, samples: Sequence[Sample], exposure: float) -> list[Scene]:
        return [
            replace(self, sample=sample, motion_progress=min(1.0, self.motion_progress + sample.time * exposure))
            for sample in samples
        ]

    @property
    def has_coats(self) -> bool:
        """Whether frames show the coats of glossy surfaces: several samples of gathered light."""
        return self.paths.gather > 0 and (self.frame.samples or 1) > 1

    @property
    def blurs(self) -> list[str]:
        """The keys that only several samples show."""
        keys = {
            "light.radius": any(light.radius > 0 for light in self.lights),
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
        return replace(self, mesh=MeshSource(name=name_or_path, crease=self.mesh.crease))

    def with_environment(self, folder: Path) -> Scene:
        """The scene in the room of a folder."""
        return replace(self, background=replace(self.background, room=folder))

    @property
    def places_camera(self) -> bool:
        """Whether the camera may be elsewhere than that of the room's maps."""
        return self.frame_camera is not None or self.camera.position is not None or bool(self.motion.camera)

    @property
    def lights(self) -> tuple[PointLight, ...]:
        """All lights; the motion moves the first one."""
        first, end = self.light, self.motion.light
        if first.position is not None and end is not None:
            first = replace(first, position=interpolate(first.position, end, self.motion_progress))
        return first, *self.more_lights

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
