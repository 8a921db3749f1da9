"""Meshes of few triangles, for designs without a tree, which test every triangle with every ray."""

from __future__ import annotations

import numpy as np
from colonnade.common.errors import UserError
from colonnade.common.types import Floats, Indices
from colonnade.mesh.load import clean_mesh
from colonnade.mesh.materials.mesh import Mesh

#: Cells along the longest edge of the finest grid.
_FINEST = 1024


def reduced_mesh(mesh: Mesh, maximum: int) -> Mesh:
    """The mesh with at most `maximum` triangles and a plain material; as it is, if it has no more.

    Vertices are clustered (Rossignac and Borrel 1993) on the finest grid that leaves so few triangles. Edge collapse
    keeps each component, and some meshes have hundreds.

    Raises:
        UserError: No grid leaves so few.
    """
    if len(mesh.faces) <= maximum:
        return mesh
    low = mesh.vertices.min(axis=0)
    places = (mesh.vertices - low) / float((mesh.vertices.max(axis=0) - low).max())
    found: tuple[Floats, Indices] | None = None
    # The number of faces grows with the grid, if not strictly
    coarse, fine = 1, _FINEST
    while coarse < fine - 1:
        cells = (coarse + fine) // 2
        vertices, faces = _clustered(mesh, np.floor(places * cells).astype(np.int64) @ [(cells + 1) ** 2, cells + 1, 1])
        if len(faces) > maximum:
            fine = cells
        else:
            coarse = cells
            found = (vertices, faces) if len(faces) else found
    if found is None:
        raise UserError(f"mesh {mesh.name} cannot be reduced to {maximum} triangles: allow more")
    return clean_mesh(found[0], found[1].astype(np.int32), mesh.name)


def _clustered(mesh: Mesh, cells: Indices) -> tuple[Floats, Indices]:
    """Replace the vertices of each cell by their mean; drop faces without area, and duplicates.

    Args:
        mesh: The mesh.
        cells: The cell of each vertex, int64 [n].
    """
    _, index, counts = np.unique(cells, return_inverse=True, return_counts=True)
    sums = np.zeros((len(counts), 3))
    np.add.at(sums, index, mesh.vertices)
    faces = index[mesh.faces]
    corners = np.sort(faces, axis=1)
    whole = np.flatnonzero((corners[:, 0] != corners[:, 1]) & (corners[:, 1] != corners[:, 2]))
    _, first = np.unique(corners[whole], axis=0, return_index=True)
    return sums / counts[:, None], faces[whole[np.sort(first)]]
