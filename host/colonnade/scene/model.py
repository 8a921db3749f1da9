"""Scenes: what to render. These classes are the schema of the scene file: its keys, ranges and defaults.

Colours and intensities are linear. Lengths are in world units, those of the mesh unless ``[transform]`` says otherwise.
Values are checked when a scene is made, by a file or by code; an unknown key is refused.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field, replace
from pathlib import Path
from typing import Annotated

from annotated_types import Ge, Interval
from pydantic import BeforeValidator, ConfigDict, Field, Strict, StrictBool, model_validator
from pydantic.dataclasses import dataclass
from typing_extensions import Self

from colonnade.common.limits import MAX_COORDINATE
from colonnade.mesh.materials import Kind

_STRICT = ConfigDict(extra="forbid")

#: The largest edge of a room's maps, pixels.
MAX_EDGE = 4096
#: More would be refused by any configuration.
MAX_BOUNCES = 15


def _require_text(value: object) -> object:
    if not isinstance(value, str | Path) or not str(value):
        raise ValueError("must be text")
    return value


# Numbers are strict: no text and no Boolean stands for one.
_Float = Annotated[float, Strict()]
_Coordinate = Annotated[_Float, Interval(ge=-MAX_COORDINATE, le=MAX_COORDINATE)]
_Share = Annotated[_Float, Interval(ge=0.0, le=1.0)]
_Intensity = Annotated[_Float, Interval(ge=0.0, le=15.0)]
_MapPixel = Annotated[_Float, Interval(ge=0.0, le=MAX_EDGE)]
_Text = Annotated[str, Field(min_length=1)]
_File = Annotated[Path, BeforeValidator(_require_text)]

Vector = tuple[float, float, float]
_Vector = tuple[_Coordinate, _Coordinate, _Coordinate]
_Colour = tuple[_Share, _Share, _Share]
_BrightColour = tuple[_Intensity, _Intensity, _Intensity]
_Pixel = tuple[_MapPixel, _MapPixel]


@dataclass(frozen=True, config=_STRICT)
class MeshSource:
    """Which mesh: a name (see `colonnade.mesh.load.load_mesh`) or a file, relative to the scene file."""

    name: _Text | None = None
    path: _File | None = None

    @model_validator(mode="after")
    def _one_of_both(self) -> Self:
        if (self.name is None) == (self.path is None):
            raise ValueError("[mesh] needs a name or a path, one of the two")
        return self


@dataclass(frozen=True, config=_STRICT)
class Transform:
    """World = rotate · scale · mesh + translate; degrees about x, then y, then z."""

    rotate: _Vector = (0.0, 0.0, 0.0)
    scale: Annotated[_Float, Interval(ge=1e-9, le=1e9)] = 1.0
    translate: _Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True, config=_STRICT)
class Camera:
    """Either placed at a position, or framing the object from a direction.

    Attributes:
        position: World; None when framing.
        target: The middle of the picture, world; None is the centre of the object's cube.
        direction: From the centre of the object's cube towards the camera, when framing.
        framing: Part of the picture's height that the object's outline takes, centred; less where its width would not
            fit.
        up: Which way is up.
        fov: Vertical field of view, degrees.
    """

    position: _Vector | None = None
    target: _Vector | None = None
    direction: _Vector = (0.45, 0.35, 1.0)
    framing: Annotated[_Float, Interval(ge=0.01, le=4.0)] = 0.7
    up: _Vector = (0.0, 1.0, 0.0)
    fov: Annotated[_Float, Interval(ge=1.0, le=150.0)] = 40.0

    @model_validator(mode="after")
    def _has_axes(self) -> Self:
        if self.target is not None and self.position is None:
            raise ValueError("camera.target needs camera.position")
        for name, value in (("up", self.up), ("direction", self.direction)):
            if not any(value):
                raise ValueError(f"camera.{name} must not be zero")
        return self


@dataclass(frozen=True, config=_STRICT)
class PointLight:
    """A point light, either at a position or relative to camera and object.

    Attributes:
        position: World; None when relative.
        offset: From the centre of the object's cube, in its edges: right, up, towards the camera.
        colour: Intensity a channel; 1 lights a surface that faces the light with its albedo.
        falloff: Distance at which it has that intensity, world units; nearer it is brighter, up to four times, farther
            darker, with the squared distance. None: equally bright everywhere.
    """

    position: _Vector | None = None
    offset: _Vector = (1.2, 1.6, 1.5)
    colour: _BrightColour = (0.9, 0.9, 0.9)
    falloff: Annotated[_Float, Interval(ge=1e-6, le=1e6)] | None = None


@dataclass(frozen=True, config=_STRICT)
class Light(PointLight):
    """The first light, with the settings that all lights share.

    Attributes:
        shadows: Whether lights cast shadows.
        shadow_offset: How far from the surface secondary rays start, in edges of the object's cube.
    """

    shadows: StrictBool = True
    shadow_offset: Annotated[_Float, Interval(ge=0.0, le=0.25)] = 1 / 2048


@dataclass(frozen=True, config=_STRICT)
class Material:
    """What the object is made of; where None, the mesh's own materials say.

    Attributes:
        kind: diffuse, mirror or glass.
        albedo: Reflected, or tint of what is mirrored or transmitted.
        ior: Index of refraction of glass.
        flat: Geometric normals instead of the vertices'.
    """

    kind: Kind | None = None
    albedo: _Colour | None = None
    ior: Annotated[_Float, Interval(ge=1.0, le=4.0)] | None = None
    flat: StrictBool = False

    @model_validator(mode="after")
    def _ior_is_of_glass(self) -> Self:
        if self.ior is not None and self.kind not in (None, "glass"):
            raise ValueError(f"material.ior belongs to glass, not to a {self.kind} material")
        return self


@dataclass(frozen=True, config=_STRICT)
class Placement:
    """Where in a room the object stands, in place of scale and translation: the file's table ``[object]``.

    Attributes:
        stand_at: Pixel (u, v) of the room's maps: the object stands on what is seen there, the world's y up; None is
            the middle of the picture, 0.7 of its height down.
        size: The longest edge of the mesh's box, metres.
        turn: About the vertical, degrees, after the transform's rotation.
    """

    stand_at: _Pixel | None = None
    size: Annotated[_Float, Interval(ge=1e-3, le=1e3)] = 0.3
    turn: Annotated[_Float, Interval(ge=-360.0, le=360.0)] = 0.0


@dataclass(frozen=True, config=_STRICT)
class Motion:
    """How an object and a light move while frames are rendered, from where the scene has them.

    Attributes:
        turn: Of the object about the vertical through its middle, degrees.
        stand_at: Pixel of the room's maps where an object that stands there ends; it goes straight to that point.
        translate: What ``transform.translate`` ends as, where the object does not stand in a room.
        light: World position where the first light ends.
    """

    turn: Annotated[_Float, Interval(ge=-36000.0, le=36000.0)] = 360.0
    stand_at: _Pixel | None = None
    translate: _Vector | None = None
    light: _Vector | None = None

    @property
    def is_closed(self) -> bool:
        """It ends as it began."""
        return self.turn % 360.0 == 0.0 and self.stand_at is None and self.translate is None and self.light is None

    def shares(self, frames: int) -> list[float]:
        """How far along the motion each frame is, 0.0 to 1.0: evenly spaced from the beginning to the end. The end of
        a closed motion is left out, so that the frames repeat without a pause.
        """
        steps = frames if self.is_closed else frames - 1
        return [frame / max(steps, 1) for frame in range(frames)]


@dataclass(frozen=True, config=_STRICT)
class Paths:
    """How rays continue from mirrors and glass.

    Attributes:
        bounces: Reflections and refractions of a path that are traced; the ray after them meets the background only.
        shadow_transmittance: Part of a light that glass transmits to a shadow.
    """

    bounces: Annotated[int, Strict(), Interval(ge=0, le=MAX_BOUNCES)] = 4
    shadow_transmittance: _Share = 0.6


@dataclass(frozen=True, config=_STRICT)
class Colour:
    """A linear colour; as ambient light it may be brighter than 1."""

    colour: _BrightColour = (0.0, 0.0, 0.0)


@dataclass(frozen=True, config=_STRICT)
class Background:
    """What rays meet that miss the object: a room, or one linear colour.

    Attributes:
        colour: Linear.
        room: The folder of a room, relative to the scene file.
    """

    colour: _Colour = (0.0, 0.0, 0.0)
    room: _File | None = None


@dataclass(frozen=True, config=_STRICT)
class FrameSize:
    """The picture's size unless the command line gives one, pixels."""

    width: Annotated[int, Strict(), Ge(1)] = 640
    height: Annotated[int, Strict(), Ge(1)] = 480


@dataclass(frozen=True, config=_STRICT)
class Scene:
    """One object, one camera, at least one light.

    With a room the camera is the room's, and the world is the room's world, in metres. ``share`` is how far along its
    motion the scene is, 0.0 to 1.0.
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
    paths: Paths = field(default_factory=Paths)
    frame: FrameSize = field(default_factory=FrameSize)
    motion: Motion = field(default_factory=Motion)
    share: float = 0.0

    def at(self, share: float) -> Scene:
        """The scene so far along its motion."""
        return replace(self, share=share)

    def with_mesh(self, name_or_path: str) -> Scene:
        """The scene with another mesh: a name, or a path relative to the working directory."""
        return replace(self, mesh=MeshSource(name=name_or_path))

    def with_environment(self, folder: Path) -> Scene:
        """The scene in a room, a folder of maps."""
        return replace(self, background=replace(self.background, room=folder))

    @property
    def lights(self) -> tuple[PointLight, ...]:
        """All lights, the first one first, where the motion has it."""
        first, end = self.light, self.motion.light
        if first.position is not None and end is not None:
            first = replace(first, position=between(first.position, end, self.share))
        return first, *self.more_lights

    @property
    def mesh_source(self) -> str | Path:
        """What `colonnade.mesh.load.load_mesh` takes."""
        if self.mesh.path is not None:
            return self.mesh.path
        assert self.mesh.name is not None
        return self.mesh.name


def between(start: Sequence[float], end: Sequence[float], share: float) -> Vector:
    """The point at a share of the straight way; both ends are exact."""
    x, y, z = ((1.0 - share) * a + share * b for a, b in zip(start, end, strict=True))
    return x, y, z
