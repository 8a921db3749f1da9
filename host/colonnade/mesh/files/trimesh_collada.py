"""What the COLLADA files of `colonnade.mesh.files.trimesh_program` need of pycollada, which reads them for trimesh."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import collada
import numpy as np
from collada.controller import Skin
from collada.polylist import Polylist
from collada.scene import ControllerNode, GeometryNode, MatrixTransform, Node
from collada.triangleset import TriangleSet

from colonnade.mesh.geometry.polygons import triangulate
from colonnade.mesh.losses import CROSSED, SHORT_FACES, Losses

_refuse, _load_controller = collada.Collada.handleError, ControllerNode.load


def prepare_collada(losses: Losses, report: Callable[[str], None]) -> None:
    """Change pycollada in this process.

    Polygons are split as those of all files, and not as fans. Skins and morphs stand in the pose in which they were
    bound; trimesh passes them over. Errors that pycollada passes over are reported.
    """

    def handle(document: Any, error: Exception) -> None:
        report(str(error))
        _refuse(document, error)

    collada.Collada.handleError = handle
    Polylist.triangleset = lambda polygons: _triangles(polygons, losses)
    ControllerNode.load = staticmethod(_bound)


def _triangles(polygons: Any, losses: Losses) -> Any:
    """In place of ``Polylist.triangleset``."""
    if polygons._triangleset is not None:
        return polygons._triangleset
    rows = polygons.index
    if len(rows):
        split = triangulate(polygons.vertex[polygons.vertex_index].astype(np.float64), polygons.vcounts)
        losses.add(SHORT_FACES, split.short)
        losses.add(CROSSED, split.crossed)
        rows = rows[split.corners.reshape(-1)]
    polygons._triangleset = TriangleSet(polygons.sources, polygons.material, rows.reshape(-1), polygons.xmlnode)
    return polygons._triangleset


def _bound(document: Any, node: Any) -> Any:
    """In place of ``ControllerNode.load``: a node of the controller's geometry."""
    found = _load_controller(document, node)
    shape, is_skin = found.controller, isinstance(found.controller, Skin)
    matrix = np.reshape(shape.bind_shape_matrix, 16) if is_skin else np.eye(4).reshape(16)
    geometry = GeometryNode(shape.geometry if is_skin else shape.source_geometry, found.materials, node)
    return Node(None, [geometry], [MatrixTransform(matrix.astype(np.float32), node)], node)
