"""The content of a mesh file before cleaning."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from colonnade.common import fixed_order
from colonnade.common.types import Floats, Indices
from colonnade.mesh.clips.faces import ClipFaces
from colonnade.mesh.materials.materials import PLAIN, MeshMaterial
from colonnade.mesh.materials.relief import Relief
from colonnade.mesh.materials.texture import Texture


@dataclass(frozen=True)
class Pieces:
    """Parts of faces.

    Attributes:
        owners: The face of each, int64 [k].
        weights: Weights of the owner's corners at the corners of each, float64 [k, 3, 3].
    """

    owners: Indices
    weights: Floats

    def __getitem__(self, chosen: Indices | slice) -> Pieces:
        return Pieces(self.owners[chosen], self.weights[chosen])

    @classmethod
    def whole(cls, faces: Indices) -> Pieces:
        """Faces themselves."""
        return cls(faces, np.repeat(np.eye(3)[None], len(faces), axis=0))

    @classmethod
    def joined(cls, *parts: Pieces) -> Pieces:
        """The values of all parts, one after the other."""
        owners = np.concatenate([part.owners for part in parts])
        return cls(owners, np.concatenate([part.weights for part in parts]))

    def corners(self, values: Floats) -> Floats:
        """Values at the corners of the faces, float64 [m, 3, …], as of the pieces, float64 [k, 3, …]."""
        own = values[self.owners]
        return fixed_order.product(self.weights, own.reshape(*own.shape[:2], -1)).reshape(own.shape)


@dataclass(frozen=True)
class RawSurface:
    """The triangles of a mesh file.

    Attributes:
        vertices: float64 [n, 3].
        faces: int64 [m, 3].
        normals: The file's normals at the corners, of any length, 0 where it has none, float64 [m, 3, 3]; None: none.
        materials: At least one.
        face_materials: int64 [m], index into `materials`.
        colours: Colours at the corners, which replace the albedo of their materials, linear, 0 to 1, NaN on faces
            without, float64 [m, 3, 3]; None: none.
        textures: Textures of the materials.
        uvs: Texture coordinates (u, v) of the corners, 0 on faces without, float64 [m, 3, 2]; None: none.
        source_faces: The face of the file that each is a part of, int64 [m]; None: themselves.
        source_count: Faces of the file, if `source_faces` is given.
        single_sided: Faces whose back viewers do not show, bool [m]; None: none.
        alphas: Alpha of the corners, which counts for materials with one, 0 to 1, float64 [m, 3]; None: all are opaque.
        relief: Normal maps of the faces; None: none.
        moves: What moves the faces, which are in the rest pose of its clip; None: nothing.
    """

    vertices: Floats
    faces: Indices
    normals: Floats | None = None
    materials: tuple[MeshMaterial, ...] = (PLAIN,)
    face_materials: Indices | None = None
    colours: Floats | None = None
    textures: tuple[Texture, ...] = ()
    uvs: Floats | None = None
    source_faces: Indices | None = None
    source_count: int = 0
    single_sided: npt.NDArray[np.bool_] | None = None
    alphas: Floats | None = None
    relief: Relief | None = None
    moves: ClipFaces | None = None

    def reversed(self, faces: npt.NDArray[np.bool_]) -> RawSurface:
        """The surface with the corners of some faces backwards, bool [m]. It has nothing that moves it."""
        names = ("faces", "normals", "colours", "uvs", "alphas")
        values = ((name, getattr(self, name)) for name in names)
        flipped = {
            name: np.where(faces.reshape(-1, *[1] * (value.ndim - 1)), value[:, ::-1], value)
            for name, value in values
            if value is not None
        }
        return replace(self, relief=None if self.relief is None else self.relief.reversed(faces), **flipped)

    def pieces(self, pieces: Pieces) -> RawSurface:
        """The surface of parts of its faces, which name the file's faces in `source_faces`."""
        owners, weights = pieces.owners, pieces.weights
        # Corners that are kept keep their vertex
        kept = weights.max(axis=2) == 1.0
        corner = np.take_along_axis(self.faces[owners], weights.argmax(axis=2), axis=1)
        own = pieces.corners(self.vertices[self.faces])
        faces = np.where(kept, corner, 0)
        faces[~kept] = len(self.vertices) + np.arange(int((~kept).sum()))
        names = ("normals", "colours", "uvs", "alphas")
        at_corners: dict[str, Any] = {
            name: pieces.corners(values) for name in names if (values := getattr(self, name)) is not None
        }
        return replace(
            self,
            vertices=np.concatenate([self.vertices, own[~kept]]),
            faces=faces,
            face_materials=self.material_index[owners],
            source_faces=owners if self.source_faces is None else self.source_faces[owners],
            source_count=self.file_faces,
            single_sided=None if self.single_sided is None else self.single_sided[owners],
            relief=None if self.relief is None else self.relief.pieces(owners, weights),
            moves=None if self.moves is None else self.moves.pieces(owners, weights),
            **at_corners,
        )

    @property
    def file_faces(self) -> int:
        """Faces of the file."""
        return len(self.faces) if self.source_faces is None else self.source_count

    @property
    def material_index(self) -> Indices:
        """`face_materials`, or zeros, int64 [m]."""
        return np.zeros(len(self.faces), dtype=np.int64) if self.face_materials is None else self.face_materials


def joined(parts: Sequence[RawSurface]) -> RawSurface:
    """The parts of a file as one surface; at least one part. All have the same materials."""
    starts = np.cumsum([0] + [len(part.vertices) for part in parts[:-1]])

    def filled(name: str, shape: tuple[int, ...], value: float) -> Floats | None:
        values = [getattr(part, name) for part in parts]
        if all(one is None for one in values):
            return None
        blanks = [np.full((len(part.faces), *shape), value) for part in parts]
        return np.concatenate([blank if one is None else one for one, blank in zip(values, blanks, strict=True)])

    file_starts = np.cumsum([0] + [part.file_faces for part in parts])
    owners = [np.arange(len(part.faces)) if part.source_faces is None else part.source_faces for part in parts]
    is_whole = all(part.source_faces is None for part in parts)
    return RawSurface(
        vertices=np.concatenate([part.vertices for part in parts]),
        faces=np.concatenate([part.faces + start for part, start in zip(parts, starts, strict=True)]),
        normals=filled("normals", (3, 3), 0.0),
        materials=parts[0].materials,
        face_materials=np.concatenate([part.material_index for part in parts]),
        colours=filled("colours", (3, 3), np.nan),
        textures=parts[0].textures,
        source_faces=None
        if is_whole
        else np.concatenate([own + start for own, start in zip(owners, file_starts[:-1], strict=True)]),
        source_count=int(file_starts[-1]),
        uvs=filled("uvs", (3, 2), 0.0),
        alphas=filled("alphas", (3,), 1.0),
        relief=Relief.joined([part.relief for part in parts], [len(part.faces) for part in parts]),
    )
