"""The mesh of a scene in Python: a name, a file, or arrays in memory."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from colonnade.common import notes
from colonnade.common.errors import UserError
from colonnade.mesh.load import clean_mesh
from colonnade.mesh.materials.mesh import Mesh


class TriangleMesh(Protocol):
    """What a scene takes of a mesh of another library, such as a ``trimesh.Trimesh``.

    Attributes:
        vertices: Numbers [n, 3].
        faces: Whole numbers [m, 3], counter-clockwise seen from outside.
    """

    vertices: Any
    faces: Any


#: A name or a file; vertices [n, 3] and faces [m, 3]; or an object that has them.
MeshLike = str | Path | tuple[ArrayLike, ArrayLike] | TriangleMesh


def mesh_table(mesh: MeshLike) -> dict[str, str]:
    """The table ``mesh`` of a scene, without the crease angle."""
    return {"path": str(mesh)} if isinstance(mesh, Path) else {"name": mesh if isinstance(mesh, str) else "memory"}


def memory_mesh(mesh: tuple[ArrayLike, ArrayLike] | TriangleMesh, crease: float | None) -> Mesh:
    """The mesh of arrays in memory, or of another library; reports its notes (`colonnade.common.notes`).

    Args:
        mesh: Vertices [n, 3] and faces [m, 3], of which the mesh has copies; or an object that has them.
        crease: Crease angle, degrees, from 0 to 180; None: the default one.

    Raises:
        UserError: They are no arrays of numbers of this shape, or the mesh cannot be rendered.
    """
    pair: Sequence[Any]
    if isinstance(mesh, tuple) and len(mesh) == 2:
        pair = mesh
    else:
        try:
            pair = mesh.vertices, mesh.faces  # type: ignore[union-attr]
        except AttributeError:
            raise UserError(
                f"the mesh is a {type(mesh).__name__}: give a name, a file, a pair (vertices, faces), or an object that"
                " has both, as trimesh.Scene.to_mesh() returns"
            ) from None
        except Exception as error:  # of another library
            raise UserError(
                f"vertices and faces of the mesh cannot be read: {type(error).__name__}: {error}"
            ) from error
    points = _array("vertices", pair[0], "iuf", "numbers").astype(np.float64)
    corners = _array("faces", pair[1], "iu", "whole numbers, indices of vertices")
    if len(corners) and not 0 <= corners.min() <= corners.max() < len(points):
        raise UserError(f"a face of the mesh names a vertex that does not exist: there are {len(points)}")
    cleaned = clean_mesh(points, corners.astype(np.int32), "memory", crease=crease)
    kind = getattr(getattr(mesh, "visual", None), "kind", None)
    lines = list(cleaned.notes)
    if kind is not None:
        lines.append(f"mesh memory: colours or textures ({kind}) are left out: save it as a GLB file to keep them")
    notes.report(lines)
    return cleaned


def _array(name: str, values: object, kinds: str, wanted: str) -> NDArray[Any]:
    """An array [n, 3] of a mesh; its type is one of numpy's `kinds`."""
    try:
        array = np.asarray(values)
    except Exception as error:  # lists of different lengths, or of another library
        raise UserError(f"the mesh's {name} are no array: give three {wanted} each, [n, 3]") from error
    if array.ndim != 2 or array.shape[1] != 3:
        raise UserError(f"the mesh's {name} have the shape {list(array.shape)}: give three numbers each, [n, 3]")
    if array.dtype.kind not in kinds or np.ma.is_masked(values):
        found = "masked in part" if np.ma.is_masked(values) else array.dtype
        raise UserError(f"the mesh's {name} are {found}: give {wanted}")
    return array
