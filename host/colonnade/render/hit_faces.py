"""The faces that a frame shows, also where objects share the records of a mesh."""

from __future__ import annotations

import numpy as np

from colonnade.common.types import Floats, Indices
from colonnade.mesh.materials.mesh import Mesh
from colonnade.render.hit_points import HitPoints
from colonnade.scene_image.file import SceneImage


def hit_faces(image: SceneImage, mesh: Mesh | None, packed: Indices, position: Floats) -> Indices:
    """The faces of the mesh's file at pixels, -1 for none.

    A pixel names a triangle of the records, not its object. Of objects that share them, it shows the one whose face is
    nearest to its point.

    Args:
        image: The scene's image.
        mesh: Its mesh; None: unknown, as only images of one mesh may be.
        packed: Packed ids, -1 for a miss, int64 [height, width].
        position: The points, mesh space, float64 [height, width, 3].
    """
    faces = np.append(image.source_faces.astype(np.int64), -1)[packed]
    instances = image.header.instances
    if mesh is None or len({one.root for one in instances}) == len(instances):
        return np.asarray(faces)
    starts = np.array([*(part.first_face for part in mesh.parts), mesh.source_count])
    owner = np.searchsorted(starts, faces, side="right") - 1
    found, least = faces, np.full(faces.shape, np.inf)
    roots = [one.root for one in instances]
    for number, root in enumerate(roots):
        first = roots.index(root)
        own = np.where((faces >= 0) & (owner == first), faces - starts[first] + starts[number], -1)
        away = _distances(HitPoints.of(mesh, own, position), position)
        found, least = np.where(away < least, own, found), np.minimum(away, least)
    return np.asarray(found)


def _distances(points: HitPoints, position: Floats) -> Floats:
    """Of positions from their faces, float64 [height, width]; infinite where there is none."""
    weights = points.weights.clip(min=0.0)
    weights /= weights.sum(axis=1, keepdims=True)
    corners = points.mesh.vertices[points.mesh.faces[points.faces]]
    distances = np.full(points.is_hit.shape, np.inf)
    nearest = np.einsum("nc,nci->ni", weights, corners)
    distances[points.is_hit] = np.linalg.norm(nearest - position[points.is_hit], axis=1)
    return distances
