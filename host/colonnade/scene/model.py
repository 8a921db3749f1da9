"""Scenes: what to render, in TOML.

Colours and intensities are linear. Lengths are in world units, those of the mesh unless ``[transform]`` says otherwise.
A key that is not known is refused, so that a typing error cannot pass unnoticed.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class MeshSource:
    """Which mesh: a name (see `colonnade.mesh.load.load_mesh`) or a file."""

    name: str | None = None
    path: Path | None = None


@dataclass(frozen=True)
class Transform:
    """World = rotate · scale · mesh + translate; degrees about x, then y, then z."""

    rotate: Vector = (0.0, 0.0, 0.0)
    scale: float = 1.0
    translate: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Camera:
    """Either a position, or a direction from which the object is framed.

    Attributes:
        position: World; None when framed.
        target: What is in the middle of the picture, world; None is the centre of the object's cube.
        direction: From the centre of the object's cube towards the camera; None when placed.
        framing: Part of the picture's height that the object's outline takes, centred; less where its
            width would not fit.
        up: Which way is up.
        fov: Vertical field of view, degrees.
    """

    position: Vector | None = None
    target: Vector | None = None
    direction: Vector | None = None
    framing: float = 0.7
    up: Vector = (0.0, 1.0, 0.0)
    fov: float = 40.0


@dataclass(frozen=True)
class Light:
    """A point light, either at a position or relative to camera and object.

    Attributes:
        position: World; None when relative.
        offset: From the centre of the object's cube, in its edges: right, up, towards the camera.
        colour: Intensity a channel; 1 lights a surface that faces it with its albedo.
        falloff: Distance at which it has that intensity, world units; nearer it is brighter, up to four times, farther
            darker, with the squared distance. None: equally bright everywhere.
        shadows: Whether any light casts shadows; of several lights the first one's counts, as for the next.
        shadow_offset: How far from the surface secondary rays start, in edges of the object's cube.
    """

    position: Vector | None = None
    offset: Vector = (1.2, 1.6, 1.5)
    colour: Vector = (0.9, 0.9, 0.9)
    falloff: float | None = None
    shadows: bool = True
    shadow_offset: float = 1 / 2048


@dataclass(frozen=True)
class Material:
    """What the object is made of; where None, the mesh's own materials say.

    Attributes:
        kind: diffuse, mirror or glass.
        albedo: Reflected, or tint of what is mirrored or let through.
        ior: Index of refraction of glass.
        flat: Geometric normals instead of the vertices'.
    """

    kind: str | None = None
    albedo: Vector | None = None
    ior: float | None = None
    flat: bool = False


@dataclass(frozen=True)
class Placement:
    """Where in a room the object stands, in place of scale and translation.

    Attributes:
        stand_at: Pixel (u, v) of the room's maps: the object stands on what is seen there, the world's y up; None is
            the middle of the picture, 0.7 of its height down.
        size: The longest edge of the mesh's box, metres.
        turn: About the vertical, degrees, after the transform's rotation.
    """

    stand_at: tuple[float, float] | None = None
    size: float = 0.3
    turn: float = 0.0


@dataclass(frozen=True)
class Motion:
    """The way that an object and a light go while frames are rendered, from where the scene has them.

    Attributes:
        turn: Of the object about the vertical through its middle, degrees.
        stand_at: Pixel of the room's maps where an object that stands there ends; it goes straight to that point.
        translate: What ``transform.translate`` ends as, where the object does not stand in a room.
        light: World position where the first light ends.
    """

    turn: float = 360.0
    stand_at: tuple[float, float] | None = None
    translate: Vector | None = None
    light: Vector | None = None

    @property
    def is_closed(self) -> bool:
        """It ends as it began."""
        return self.turn % 360.0 == 0.0 and self.stand_at is None and self.translate is None and self.light is None

    def shares(self, frames: int) -> list[float]:
        """How far along the way each frame is, 0.0 to 1.0: evenly spaced from the beginning to the end. The end of a
        closed way is left out, so that the frames repeat without a pause.
        """
        steps = frames if self.is_closed else frames - 1
        return [frame / max(steps, 1) for frame in range(frames)]


@dataclass(frozen=True)
class Paths:
    """How rays go on from mirrors and glass.

    Attributes:
        bounces: Reflections and refractions of a path that are traced; the ray after them meets the background only.
        shadow_transmittance: What glass lets through of a light.
    """

    bounces: int = 4
    shadow_transmittance: float = 0.6


@dataclass(frozen=True)
class Colour:
    """A linear colour."""

    colour: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Background:
    """What rays meet that miss the object: a room, or one linear colour."""

    colour: Vector = (0.0, 0.0, 0.0)
    room: Path | None = None


@dataclass(frozen=True)
class FrameSize:
    """The picture's size unless the command line gives one, pixels."""

    width: int = 640
    height: int = 480


@dataclass(frozen=True)
class Scene:
    """One object, one camera, at least one light.

    With a room the camera is the room's, and the world is the room's world, in metres. ``share`` is how far along its
    motion the scene is, 0.0 to 1.0.
    """

    mesh: MeshSource
    transform: Transform = field(default_factory=Transform)
    camera: Camera = field(default_factory=lambda: Camera(direction=(0.45, 0.35, 1.0)))
    light: Light = field(default_factory=Light)
    more_lights: tuple[Light, ...] = ()
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
    def lights(self) -> tuple[Light, ...]:
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


def between(start: Vector, end: Vector, share: float) -> Vector:
    """The point at a share of the straight way; both ends are exact."""
    x, y, z = ((1.0 - share) * a + share * b for a, b in zip(start, end, strict=True))
    return x, y, z
