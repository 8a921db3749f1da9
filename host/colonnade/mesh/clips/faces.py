"""The faces that a clip moves, and parts of them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from colonnade.common import fixed_order
from colonnade.common.types import Floats, Indices
from colonnade.mesh.clips.clip import Clip


@dataclass(frozen=True, eq=False)
class ClipFaces:
    """What moves the faces of a surface, each a part of a face of the file.

    Attributes:
        clip: The clip.
        corners: Its vertices at the corners of the file's faces, int64 [f, 3].
        owners: The file's face of each, int64 [m].
        weights: Weights of that face's corners at the corners of each, float64 [m, 3, 3].
    """

    clip: Clip
    corners: Indices
    owners: Indices
    weights: Floats

    @classmethod
    def whole(cls, clip: Clip, corners: Indices) -> ClipFaces:
        """The faces of a file themselves."""
        return cls(clip, corners, np.arange(len(corners)), np.repeat(np.eye(3)[None], len(corners), axis=0))

    def pieces(self, owners: Indices, weights: Floats) -> ClipFaces:
        """The faces of parts of the surface's faces, by the weights of their corners, float64 [k, 3, 3]."""
        return replace(self, owners=self.owners[owners], weights=fixed_order.product(weights, self.weights[owners]))

    def kept(self, faces: Indices) -> ClipFaces:
        """Some of the surface's faces."""
        return replace(self, owners=self.owners[faces], weights=self.weights[faces])

    def reversed(self, faces: npt.NDArray[np.bool_]) -> ClipFaces:
        """The same of a surface some of whose faces have the other winding."""
        return replace(self, weights=np.where(faces[:, None, None], self.weights[:, ::-1], self.weights))

    def with_vertices(self) -> tuple[Clip, Indices]:
        """The clip with vertices at the corners of all faces (``cpp/mesh/clip_faces.hpp``), and these, int64 [m, 3]."""
        positions, bones, weights, targets, vertices, added, normals, corners = self.clip.compiled.parts(
            self.corners.astype(np.int32), self.owners, np.ascontiguousarray(self.weights)
        )
        morphs = replace(self.clip.morphs, targets=targets, vertices=vertices, positions=added, normals=normals)
        clip = replace(self.clip, positions=positions, bones=bones, weights=weights, morphs=morphs)
        return clip, corners.astype(np.int64)
