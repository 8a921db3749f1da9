"""The header of a scene image: what the image contains, and where."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from colonnade.common import fixed_order
from colonnade.common.types import Floats
from colonnade.mesh.materials.materials import MeshMaterial
from colonnade.mesh.materials.mesh import Extent, MeshPart


@dataclass(frozen=True)
class TreeStatistics:
    """Size and cost of a tree.

    Attributes:
        nodes, leaves: Number of node records and leaf records.
        depth: Nodes on the longest path from the root.
        stack_bound: Largest number of stack entries that a ray can need.
        cost: Expected record reads of a random ray through the root box, by the surface-area heuristic.
        height_limit: Limit of the binary tree's levels that keeps the stack within its depth; 0 for none.
    """

    nodes: int
    leaves: int
    depth: int
    stack_bound: int
    cost: float
    height_limit: int


@dataclass(frozen=True)
class ObjectFrame:
    """The transform from mesh space to vertex units: ``unit_vertex = (vertex - offset) * scale``.

    Attributes:
        scale: Vertex units per mesh unit.
        offset: Mesh coordinates of vertex-unit position (0, 0, 0).
    """

    scale: float
    offset: tuple[float, float, float]


@dataclass(frozen=True)
class Instance:
    """A packed mesh at a place of the world.

    Attributes:
        frame: Transform from mesh space to its own vertex units.
        bounds_low, bounds_high: Of the mesh, its vertex units, inclusive.
        largest_triangle: Greatest extent of its triangles along an axis, its vertex units.
        transform: From mesh to world coordinates, four rows of four; it may mirror, scale and shear.
        root: Address of its root node.
        material_base: Added to the materials of its faces.
    """

    frame: ObjectFrame
    bounds_low: tuple[int, int, int]
    bounds_high: tuple[int, int, int]
    largest_triangle: int
    transform: tuple[tuple[float, ...], ...]
    root: int = 0
    material_base: int = 0

    @staticmethod
    def of(header: ImageHeader, transform: Floats, root: int = 0, material_base: int = 0) -> Instance:
        """The mesh of an image at a place; `transform` is float64 [4, 4]."""
        rows = tuple(tuple(float(value) for value in row) for row in transform)
        box = (header.frame, header.bounds_low, header.bounds_high, header.largest_triangle)
        return Instance(*box, rows, root, material_base)

    @property
    def box(self) -> Floats:
        """The corners of the mesh's box, float64 [8, 3]."""
        low, high = self.bounds_low, self.bounds_high
        units = np.array([[(low, high)[i >> a & 1][a] for a in range(3)] for i in range(8)], float)
        return np.asarray(units / self.frame.scale + np.array(self.frame.offset))

    @property
    def corners(self) -> Floats:
        """The same in the world."""
        matrix = np.array(self.transform)
        return np.asarray(fixed_order.product(self.box, matrix[:3, :3].T) + matrix[:3, 3])


@dataclass(frozen=True)
class LoadedMemory:
    """Number and size of the words for a memory.

    Attributes:
        memory: Its name in the manifest, e.g. ``albedo.palette``.
        words: Number of words, from address 0.
        word_bytes: Bytes per word, rounded up.
    """

    memory: str
    words: int
    word_bytes: int

    @property
    def bytes(self) -> int:
        """Size in the file, bytes."""
        return self.words * self.word_bytes


@dataclass(frozen=True)
class EnvironmentHeader:
    """The room of an image's maps.

    Attributes:
        name: Name of the room.
        depth_unit: Depth of w = 1 in the plane map, metres: w = depth_unit / depth.
        memories: Memories of the physical-attribute memory, in the file's order.
    """

    name: str
    depth_unit: float
    memories: tuple[LoadedMemory, ...]


@dataclass(frozen=True)
class TextureHeader:
    """The textures of an image, for hardware with a texture memory.

    Attributes:
        textures: Their number; with 0 the memory holds zeros.
        scale: Texels of the atlas for each pixel of a texture, along an axis.
        source_bytes: Size of the textures, three bytes a pixel.
        memories: Memories of the textures, in the file's order, after a room's.
    """

    textures: int
    scale: float
    source_bytes: int
    memories: tuple[LoadedMemory, ...]


@dataclass(frozen=True)
class ImageHeader:
    """Description of a scene image's content.

    Attributes:
        format_hash: Format hash of the manifest that it was packed for.
        mesh: Name of the mesh.
        source_triangles: Faces of the mesh file.
        triangles: Packed triangles.
        record_bits, record_count: Width and number of the column memory's records.
        nodes, leaves: Their numbers; the root is record 0. The rest are companions of leaves.
        bounds_low, bounds_high: The object's bounding box, vertex units, inclusive.
        largest_triangle: Greatest extent of a triangle along an axis, vertex units.
        frame: Transform from mesh space to vertex units.
        extent: Bounds in mesh space, for framing.
        materials: Materials by the faces' material index.
        tree: Size and cost of the tree; None without nodes.
        room: The room; None without a room's maps.
        parts: The objects of a scene with several, by their source faces.
        texture: The textures; None for hardware without.
        instances: The objects that have transforms of their own, whose world `frame` and bounds are; empty: the records
            are one mesh.
        light: The memory of the light cube, after all others; empty without gathered light.
        parallax: Of the light cube, the register `gather.parallax`.
    """

    format_hash: str
    mesh: str
    source_triangles: int
    triangles: int
    record_bits: int
    record_count: int
    nodes: int
    leaves: int
    bounds_low: tuple[int, int, int]
    bounds_high: tuple[int, int, int]
    largest_triangle: int
    frame: ObjectFrame
    extent: Extent
    materials: tuple[MeshMaterial, ...]
    tree: TreeStatistics | None
    room: EnvironmentHeader | None = None
    parts: tuple[MeshPart, ...] = ()
    texture: TextureHeader | None = None
    instances: tuple[Instance, ...] = ()
    light: tuple[LoadedMemory, ...] = ()
    parallax: int = 0

    @property
    def has_colours(self) -> bool:
        """Whether each leaf is followed by its companion."""
        return self.record_count > self.nodes + self.leaves

    @property
    def memories(self) -> tuple[LoadedMemory, ...]:
        """Memories of a room, of the textures and of the light cube, in the file's order."""
        maps, textures = (part.memories if part else () for part in (self.room, self.texture))
        return (*maps, *textures, *self.light)

    def to_json(self) -> dict[str, Any]:
        """Convert to a JSON object; floats keep their exact values."""
        data = asdict(self)
        data["extent"] = {name: np.asarray(value).tolist() for name, value in data["extent"].items()}
        return data

    @staticmethod
    def from_json(data: dict[str, Any]) -> ImageHeader:
        """Convert from a checked JSON object of `to_json`."""
        values = dict(data)
        values["bounds_low"] = tuple(values["bounds_low"])
        values["bounds_high"] = tuple(values["bounds_high"])
        frame = values["frame"]
        values["frame"] = ObjectFrame(frame["scale"], tuple(frame["offset"]))
        values["parts"] = tuple(MeshPart(**part) for part in values["parts"])
        extent = {name: np.array(value, dtype=np.float64) for name, value in values["extent"].items()}
        values["extent"] = Extent(**extent)
        values["materials"] = tuple(MeshMaterial(**_with_tuples(material)) for material in values["materials"])
        values["tree"] = TreeStatistics(**values["tree"]) if values["tree"] else None
        if environment := values["room"]:
            memories = tuple(LoadedMemory(**memory) for memory in environment["memories"])
            values["room"] = EnvironmentHeader(environment["name"], environment["depth_unit"], memories)
        if texture := values["texture"]:
            memories = tuple(LoadedMemory(**memory) for memory in texture["memories"])
            values["texture"] = TextureHeader(**{**texture, "memories": memories})
        # Older files lack these keys
        values["instances"] = tuple(_instance(one) for one in values.get("instances", ()))
        values["light"] = tuple(LoadedMemory(**memory) for memory in values.get("light", ()))
        return ImageHeader(**values)


def _instance(values: Mapping[str, Any]) -> Instance:
    frame, rows = values["frame"], tuple(tuple(row) for row in values["transform"])
    frame = ObjectFrame(frame["scale"], tuple(frame["offset"]))
    return Instance(**{**_with_tuples(values), "frame": frame, "transform": rows})


def _with_tuples(values: Mapping[str, Any]) -> dict[str, Any]:
    """The values of JSON, with tuples for lists."""
    return {key: tuple(value) if isinstance(value, list) else value for key, value in values.items()}
