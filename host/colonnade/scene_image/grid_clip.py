"""A clip in whole numbers, as a target has it: vertices, bones and keys on the object's grid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from colonnade.common.errors import UserError
from colonnade.mesh.materials.mesh import Mesh
from colonnade.scene_image.header import ObjectFrame

Integers = npt.NDArray[np.int64]

#: Fraction bits of times.
TIME_FRACTION = 16


@dataclass(frozen=True)
class GridClip:
    """A clip in the numbers of a clip file (docs/driver.md).

    Attributes:
        frame: From the scene of the mesh to vertex units, for all poses.
        low, high: Bounds of all poses, vertex units.
        corners: The vertex of the clip at each corner of the mesh's faces, int32 [m, 3].
        vertices: Bound position, normal, bones, and weights of all bones but the first, int64 [v, 3 + 3 + 4 + 3].
        changes: Vertex, position, normal and target of what morph targets add, int64 [d, 1 + 3 + 3 + 1].
        times: Of the keys, 2^-16 s, int64 [k].
        poses: Of the keys: matrices of bones row by row, and weights of targets, int64 [k, 12 b + t].
        rest: The rest pose, int64 [12 b + t].
        bones, targets: Their numbers.
        linear_shift, shift: Extra fraction bits of matrices; fraction bits of translations.
    """

    frame: ObjectFrame
    low: tuple[int, int, int]
    high: tuple[int, int, int]
    corners: npt.NDArray[np.int32]
    vertices: Integers
    changes: Integers
    times: Integers
    poses: Integers
    rest: Integers
    bones: int
    targets: int
    linear_shift: int
    shift: int


def grid_clip(mesh: Mesh, vertex_bits: int) -> GridClip:
    """Put the clip of a mesh on a grid that holds all of its poses (``cpp/packer/grid_clip.hpp``).

    Raises:
        UserError: The clip is too long, moves too far, or has weights that are too large.
    """
    clip = mesh.clip
    assert clip is not None and mesh.clip_corners is not None
    found = clip.compiled.grid(
        np.ascontiguousarray(mesh.vertices),
        np.ascontiguousarray(mesh.faces, dtype=np.int32),
        np.ascontiguousarray(mesh.corner_normals),
        np.ascontiguousarray(mesh.clip_corners, dtype=np.int32),
        vertex_bits,
    )
    if error := found.pop("error"):
        raise UserError(f"mesh {mesh.name}: its animation {clip.name} {error}")
    return GridClip(frame=ObjectFrame(found.pop("scale"), found.pop("offset")), **found)
