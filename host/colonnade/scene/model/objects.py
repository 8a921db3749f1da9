"""The objects of a scene: meshes, materials and places."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from pathlib import Path
from typing import Annotated, Literal

from annotated_types import Interval
from pydantic import BeforeValidator, StrictBool, model_validator
from pydantic.dataclasses import dataclass
from typing_extensions import Self

from colonnade.mesh.clips.tracks import Animation
from colonnade.mesh.materials.materials import Kind
from colonnade.scene.model.values import (
    STRICT,
    Degrees,
    File,
    Float,
    Fraction,
    LinearColour,
    RoomPixel,
    Text,
    Triangles,
    WorldVector,
)


def _as_keys(value: object) -> object:
    """A single table is a single key."""
    return (value,) if isinstance(value, Mapping) else value


def _as_text(value: object) -> object:
    """The number of an animation as text."""
    return str(value) if isinstance(value, int) and not isinstance(value, bool) and value >= 0 else value


AnimationName = Annotated[Text, BeforeValidator(_as_text, json_schema_input_type=Text | Annotated[int, Interval(ge=0)])]


@dataclass(frozen=True, config=STRICT)
class MeshSource:
    """The mesh: a name (see `colonnade.mesh.load.load_mesh`), or a file relative to the scene file.

    Attributes:
        name, path: One of them.
        crease: Angle up to which edges are smooth, degrees, in place of the file's normals. None: the file's normals,
            without them 60 degrees.
        simplify: Number of triangles to which a mesh of more is simplified. None: all are kept.
        animation: Name or number of an animation of a glTF file, which the frames of a motion play once.
        animation_file: The glTF file of the animation, whose nodes have the names of the mesh's. None: the mesh's own.
        children: Most children of a node of the packer's tree: 2 is a binary tree, as in the source paper.
    """

    name: Text | None = None
    path: File | None = None
    crease: Annotated[Float, Interval(ge=0.0, le=180.0)] | None = None
    simplify: Triangles | None = None
    animation: AnimationName | None = None
    animation_file: File | None = None
    children: Literal[2, 4] = 4

    @model_validator(mode="after")
    def _exactly_one(self) -> Self:
        if (self.name is None) == (self.path is None):
            raise ValueError("[mesh] needs either a name or a path")
        if self.animation is not None and self.simplify is not None:
            raise ValueError("mesh.animation moves all triangles: leave out mesh.simplify")
        if self.animation_file is not None and self.animation is None:
            raise ValueError('mesh.animation_file needs mesh.animation: the name of one, or "0" for the first')
        return self

    @property
    def played(self) -> Animation | None:
        """The argument for `colonnade.mesh.load.load_mesh`."""
        return None if self.animation is None else Animation(self.animation, self.animation_file)

    @property
    def source(self) -> str | Path:
        """The argument for `colonnade.mesh.load.load_mesh`."""
        if self.path is not None:
            return self.path
        assert self.name is not None
        return self.name


@dataclass(frozen=True, config=STRICT)
class Transform:
    """World = rotate · scale · mesh + translate; ``rotate`` is in degrees about x, then y, then z."""

    rotate: WorldVector = (0.0, 0.0, 0.0)
    scale: Annotated[Float, Interval(ge=1e-9, le=1e9)] = 1.0
    translate: WorldVector = (0.0, 0.0, 0.0)


@dataclass(frozen=True, config=STRICT)
class Material:
    """Overrides of the mesh's materials; None keeps the mesh's value.

    Attributes:
        kind: diffuse, mirror or glass.
        albedo: Diffuse reflectance, or tint of reflected or refracted light.
        ior: Index of refraction of glass.
        roughness: Of a mirror or glass, or of the coat of a diffuse surface, 0 to 1.
        flat: Use geometric normals instead of smooth ones.
    """

    kind: Kind | None = None
    albedo: LinearColour | None = None
    ior: Annotated[Float, Interval(ge=1.0, le=4.0)] | None = None
    roughness: Annotated[Float, Interval(ge=0.0, le=1.0)] | None = None
    flat: StrictBool = False

    @model_validator(mode="after")
    def _values_are_of_the_kind(self) -> Self:
        if self.ior is not None and self.kind not in (None, "glass"):
            raise ValueError(f"material.ior is for glass, not for a {self.kind} material")
        return self


@dataclass(frozen=True, config=STRICT)
class Placement:
    """The object's place in a room, instead of scale and translation: the file's table ``[object]``.

    Attributes:
        stand_at: Pixel (u, v) of the room's maps; the object stands on its surface point, with the world's y up. None:
            on a level surface in view that has room for it (`colonnade.scene.standing.free_place`).
        size: Longest edge of the mesh's bounding box, metres.
        turn: Rotation about the vertical, degrees, after the transform's rotation.
    """

    stand_at: RoomPixel | None = None
    size: Annotated[Float, Interval(ge=1e-3, le=1e3)] = 0.3
    turn: Annotated[Float, Interval(ge=-360.0, le=360.0)] = 0.0


@dataclass(frozen=True, config=STRICT)
class ObjectKey:
    """Where an object is at a moment of the motion: a table ``[[object.motion]]``. None: as at the key before.

    Before the first key it is where its place is, without a turn.

    Attributes:
        at: Progress of the motion.
        turn: Rotation about the vertical through its centre, degrees, after ``rotate``.
        rotate: Rotation about x, then y, then z through its centre, degrees.
        translate: Shift from its place, world units.
    """

    at: Fraction = 1.0
    turn: Degrees | None = None
    rotate: tuple[Degrees, Degrees, Degrees] | None = None
    translate: WorldVector | None = None


@dataclass(frozen=True, config=STRICT)
class SceneObject(Placement):
    """One of several objects: a table ``[[object]]``. In a room it stands, unless its transform scales or moves it.

    Attributes:
        mesh: Its mesh.
        transform: Its pose in the world; if it stands, only the rotation.
        material: Overrides of its mesh's materials.
        motion: Its own motion, by ascending progress, from its place on; straight ways and even turns in between.
    """

    mesh: MeshSource = field(kw_only=True)
    transform: Transform = field(default_factory=Transform, kw_only=True)
    material: Material = field(default_factory=Material, kw_only=True)
    motion: Annotated[tuple[ObjectKey, ...], BeforeValidator(_as_keys)] = field(default=(), kw_only=True)

    @model_validator(mode="after")
    def _ascends(self) -> Self:
        times = [key.at for key in self.motion]
        if sorted(set(times)) != times:
            raise ValueError("object.motion.at must ascend from key to key")
        return self

    @property
    def stages(self) -> list[tuple[float, tuple[float, ...]]]:
        """Progress and state at the keys of its motion, from 0 on: turn, rotation about x, y, z, and shift."""
        found: list[tuple[float, tuple[float, ...]]] = [(0.0, (0.0,) * 7)]
        for key in self.motion:
            turn, rotate, shift = found[-1][1][:1], found[-1][1][1:4], found[-1][1][4:]
            turn = turn if key.turn is None else (key.turn,)
            found.append((key.at, (*turn, *(key.rotate or rotate), *(key.translate or shift))))
        return found[1:] if len(found) > 1 and found[1][0] == 0.0 else found

    @property
    def returns(self) -> bool:
        """Whether its own motion ends as it begins."""
        (_, first), *_, (_, last) = [*self.stages, self.stages[-1]]
        return first[4:] == last[4:] and not any((b - a) % 360.0 for a, b in zip(first[:4], last[:4], strict=True))

    @property
    def stands(self) -> bool:
        """Whether a room places it."""
        return self.transform.scale == 1.0 and not any(self.transform.translate)
