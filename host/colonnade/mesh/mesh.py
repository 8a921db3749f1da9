"""A clean triangle mesh: what `colonnade.mesh.load.load_mesh` returns."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from colonnade.common.types import Floats
from colonnade.mesh import primitives
from colonnade.mesh.materials import MeshMaterial
from colonnade.mesh.topology import Faces


@dataclass(frozen=True)
class Extent:
    """What framing needs of a mesh: its box and the vertices that lie outermost.

    Attributes:
        low, high: The box, float64 [3], mesh space.
        outline: Vertices that are outermost in one of many directions, float64 [k, 3], mesh space.
    """

    low: Floats
    high: Floats
    outline: Floats

    @property
    def edge(self) -> float:
        """Edge of the bounding cube, mesh units."""
        return float((self.high - self.low).max())

    @property
    def centre(self) -> Floats:
        """Centre of box and cube, float64 [3]."""
        return (self.low + self.high) / 2


@dataclass(frozen=True)
class Mesh:
    """A clean triangle mesh.

    Attributes:
        vertices: float64 [n, 3], mesh space.
        faces: int32 [m, 3], counter-clockwise seen from outside.
        vertex_normals: float64 [n, 3], unit length, or 0 where the faces cancel.
        materials: What its surfaces are made of, as its file says; at least one.
        face_materials: uint8 [m], index into `materials`.
        source_faces: int32 [m], the face's number in the source, where dropped faces count too.
        source_count: Faces of the source.
        name: For reports.
    """

    vertices: Floats
    faces: Faces
    vertex_normals: Floats
    materials: tuple[MeshMaterial, ...]
    face_materials: npt.NDArray[np.uint8]
    source_faces: npt.NDArray[np.int32]
    source_count: int
    name: str

    @cached_property
    def extent(self) -> Extent:
        """Box and outline."""
        points, _ = primitives.sphere(720)
        directions = np.unique(points, axis=0)
        outermost: set[int] = set()
        for direction in directions[directions[:, 0] >= 0]:
            reach = self.vertices @ direction
            outermost |= {int(reach.argmax()), int(reach.argmin())}
        return Extent(self.vertices.min(axis=0), self.vertices.max(axis=0), self.vertices[sorted(outermost)])
