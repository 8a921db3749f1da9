"""The objects of a scene: meshes, materials and places."""

from __future__ import annotations

from dataclasses import field
from pathlib import Path
from typing import Annotated, Literal

from annotated_types import Interval
from pydantic import StrictBool, model_validator
from pydantic.dataclasses import dataclass
from typing_extensions import Self

from colonnade.mesh.materials.materials import Kind
from colonnade.scene.model.values import STRICT, File, Float, LinearColour, RoomPixel, Text, Triangles, WorldVector


@dataclass(frozen=True, config=STRICT)
class MeshSource:
    """The mesh: a name (see `colonnade.mesh.load.load_mesh`), or a file relative to the scene file.

    Attributes:
        name, path: One of them.
        crease: Angle up to which edges are smooth, degrees, in place of the file's normals. None: the file's normals,
            without them 60 degrees.
        simplify: Number of triangles to which a mesh of more is simplified. None: all are kept.
        animation: Name or number of an animation of a glTF file, which the frames of a motion play once.
        children: Most children of a node of the packer's tree: 2 is a binary tree, as in the source paper.
    """

    name: Text | None = None
    path: File | None = None
    crease: Annotated[Float, Interval(ge=0.0, le=180.0)] | None = None
    simplify: Triangles | None = None
    animation: Text | None = None
    children: Literal[2, 4] = 4

    @model_validator(mode="after")
    def _exactly_one(self) -> Self:
        if (self.name is None) == (self.path is None):
            raise ValueError("[mesh] needs either a name or a path")
        if self.animation is not None and self.simplify is not None:
            raise ValueError("mesh.animation moves all triangles: leave out mesh.simplify")
        return self

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
