"""The clean triangle mesh, made by `colonnade.mesh.load`."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np
import numpy.typing as npt

from colonnade.common import fixed_order
from colonnade.common.types import Floats, Indices
from colonnade.common.vectors import cofactors, unit_vectors
from colonnade.mesh.clips.clip import Clip
from colonnade.mesh.clips.joined import Place
from colonnade.mesh.clips.keys import baked
from colonnade.mesh.geometry import primitives
from colonnade.mesh.geometry.topology import Faces
from colonnade.mesh.materials.materials import MeshMaterial
from colonnade.mesh.materials.texture import Texture


@dataclass(frozen=True)
class Extent:
    """The bounds of a mesh, for framing the camera.

    Attributes:
        low, high: The bounding box, float64 [3], mesh space.
        outline: The extreme vertices along many directions, float64 [k, 3], mesh space.
    """

    low: Floats
    high: Floats
    outline: Floats

    @property
    def edge(self) -> float:
        """Edge length of the bounding cube, mesh units."""
        return float((self.high - self.low).max())

    @property
    def centre(self) -> Floats:
        """Centre of the bounding box, float64 [3]."""
        return (self.low + self.high) / 2


@dataclass(frozen=True)
class MeshPart:
    """One of the objects of a joined mesh.

    Attributes:
        name: Name of its mesh.
        first_face: Number of its face 0 in the source faces of the joined mesh.
        edge: Longest edge of its mesh's box, units of the joined mesh.
    """

    name: str
    first_face: int
    edge: float


@dataclass(frozen=True)
class PlacedMesh:
    """The geometry of one of the objects of a joined mesh, in its own space; its faces follow earlier objects' faces.

    Attributes:
        vertices: float64 [n, 3].
        faces: int32 [m, 3].
        corner_normals: float64 [m, 3, 3].
        transform: From there to the joined mesh at rest, float64 [4, 4]: a rotation, a scale and a translation.
        place: Where it moves; None: it keeps its transform.
        clip, clip_corners: As of a mesh.
    """

    vertices: Floats
    faces: Faces
    corner_normals: Floats
    transform: Floats
    place: Place | None = None
    clip: Clip | None = None
    clip_corners: Indices | None = None

    def transform_at(self, time: float) -> Floats:
        """Its transform at a time, seconds."""
        return self.transform if self.place is None else self.place.at(time)


@dataclass(frozen=True)
class Mesh:
    """A clean triangle mesh: no duplicate vertices, no degenerate or duplicate triangles.

    Attributes:
        vertices: float64 [n, 3], mesh space.
        faces: int32 [m, 3], counter-clockwise seen from outside.
        corner_normals: Shading normals at the corners of the faces, unit length, or 0 where normals of the adjacent
            faces cancel, float64 [m, 3, 3].
        materials: Materials of the mesh file; at least one.
        face_materials: uint8 [m], index into `materials`.
        source_faces: int32 [m], the face's index in the source, which includes dropped faces.
        source_count: Number of faces in the source.
        name: Name for reports.
        notes: Lines on what the file holds and a picture does not show, and on what was repaired.
        parts: The objects of a joined mesh, in the order of their source faces; none of a single mesh.
        objects: Their geometry.
        corner_colours: Linear colours at the corners of the faces, 0 to 1, 0 on faces whose material has none, float64
            [m, 3, 3]; None: no material has any.
        textures: Base-colour textures of the materials.
        corner_uvs: Texture coordinates (u, v) of the corners of the faces, 0 on faces
            without one, float64 [m, 3, 2]; None: no material has a texture.
        clip: What moves the mesh, which is in its rest pose; None: nothing.
        clip_corners: The vertex of the clip at each corner of the faces, int64 [m, 3]; None: as the clip.
    """

    vertices: Floats
    faces: Faces
    corner_normals: Floats
    materials: tuple[MeshMaterial, ...]
    face_materials: npt.NDArray[np.uint8]
    source_faces: npt.NDArray[np.int32]
    source_count: int
    name: str
    notes: tuple[str, ...] = ()
    parts: tuple[MeshPart, ...] = ()
    objects: tuple[PlacedMesh, ...] = ()
    corner_colours: Floats | None = None
    textures: tuple[Texture, ...] = ()
    corner_uvs: Floats | None = None
    clip: Clip | None = None
    clip_corners: Indices | None = None

    @cached_property
    def extent(self) -> Extent:
        """The bounding box and the outline; of a mesh with a clip the box of all of its poses, and its corners."""
        if self.clip is not None:
            clip = baked(self.clip)
            corners = np.array(list(product(*zip(clip.low, clip.high, strict=True))))
            return Extent(clip.low, clip.high, corners)
        points, _ = primitives.sphere(720)
        directions = np.unique(points, axis=0)
        outermost: set[int] = set()
        for direction in directions[directions[:, 0] >= 0]:
            height = fixed_order.product(self.vertices, direction)
            outermost |= {int(height.argmax()), int(height.argmin())}
        return Extent(self.vertices.min(axis=0), self.vertices.max(axis=0), self.vertices[sorted(outermost)])

    def posed(self, progress: float) -> Mesh:
        """The mesh at a part of its clip, 0.0 to 1.0, its normals turned with their faces; itself if nothing moves."""
        if self.clip is None:
            return self
        pose = self.clip.pose(progress * self.clip.duration)
        faces = self.faces if self.clip_corners is None else self.clip_corners.astype(np.int32)
        vertices = self.clip.vertices(pose.matrices, pose.weights)
        rest = self.clip.rest()
        before, after = _axes(self.clip.vertices(rest.matrices, rest.weights)[faces]), _axes(vertices[faces])
        # From the axes at rest to the pose's, times a determinant above 0
        turns = fixed_order.product(cofactors(before), after.transpose(0, 2, 1))
        normals = unit_vectors(fixed_order.product(self.corner_normals, turns))
        return replace(self, vertices=vertices, faces=faces, corner_normals=normals)


def _axes(corners: Floats) -> Floats:
    """Two edges of faces, float64 [n, 3, 3], and their normals of about that length, as columns."""
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normals = np.cross(first, second)
    normals /= np.sqrt(np.linalg.norm(normals, axis=1)).clip(min=1e-300)[:, None]
    return np.stack([first, second, normals], axis=2)
