"""A room's real geometry as background: what a camera would see, in place of what the depth map tells.

Points that the photo shows have the colours and normals of their pixels. All others have the colours of the mesh.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from colonnade.common.srgb import linear_from_srgb
from colonnade.common.types import Floats, Indices
from colonnade.common.vectors import unit_vectors
from colonnade.mesh.load import load_mesh
from colonnade.mesh.materials.materials import PLAIN
from colonnade.reference.embree import RayTracer, Triangles
from colonnade.reference.environment.surface import Backdrop, BackdropPoints, BoundingSurface, SurfaceHits

if TYPE_CHECKING:
    from colonnade.environment.model import Environment
    from colonnade.mesh.materials.mesh import Mesh

#: A point is what its pixel shows if nothing lies in front of it by more than this, metres.
VISIBLE = 0.02


@dataclass(frozen=True)
class TrueSurface:
    """A room's mesh in view space, and the albedo of its faces, linear, float64 [m, 3]."""

    tracer: RayTracer
    albedo: Floats

    def intersect(self, origins: Floats, directions: Floats) -> SurfaceHits:
        """First hits of rays, float64 [n, 3] each. Positions in the maps are left to the room."""
        faces, position = self.hits(origins, directions)
        nowhere = np.full(len(faces), np.nan)
        return SurfaceHits(position, nowhere, nowhere, faces < 0)

    def hits(self, origins: Floats, directions: Floats) -> tuple[Indices, Floats]:
        """Faces, -1 for a miss, and positions, NaN for a miss, of the first hits of rays."""
        faces = self.tracer.first_hits(origins, directions)
        hit = np.flatnonzero(faces >= 0)
        position = np.full((len(origins), 3), np.nan)
        position[hit] = self.tracer.surface_points(faces[hit], origins[hit], directions[hit]).position
        return faces, position

    def normals(self, faces: Indices, directions: Floats) -> Floats:
        """Unit normals of faces that face the rays, float64 [n, 3]."""
        corners = self.tracer.corners[faces]
        normals = unit_vectors(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
        return np.where(np.einsum("ni,ni->n", normals, directions)[:, None] > 0, -normals, normals)


@dataclass(frozen=True)
class TrueRoom(Backdrop):
    """A room as background whose geometry is a mesh; see the module."""

    surface: TrueSurface | None = None

    def visible_points(self, u: Floats, v: Floats) -> BackdropPoints:
        """Points that the camera sees at pixels (u, v) of the maps, float64 [n] each; holes have the map's depth."""
        assert self.surface is not None
        points, environment = super().visible_points(u, v), self.environment
        rays = np.stack([(u - environment.cx) / environment.fx, (v - environment.cy) / environment.fy], axis=1)
        rays = np.column_stack([rays, np.ones(len(rays))])
        faces, position = self.surface.hits(np.zeros_like(rays), rays)
        position = np.where((faces >= 0)[:, None], position, points.position)
        return BackdropPoints(position, points.normals, points.albedo, points.outside)

    def intersect(self, origins: Floats, directions: Floats) -> BackdropPoints:
        """Points where rays of view space, float64 [n, 3] each, hit the room."""
        assert self.surface is not None
        count, environment = len(origins), self.environment
        faces, position = self.surface.hits(origins, directions)
        normals, albedo = np.zeros((count, 3)), np.zeros((count, 3))
        hit = np.flatnonzero(faces >= 0)
        normals[hit] = self.surface.normals(faces[hit], directions[hit])
        albedo[hit] = self.surface.albedo[faces[hit]]
        with np.errstate(divide="ignore", invalid="ignore"):
            u = position[:, 0] / position[:, 2] * environment.fx + environment.cx
            v = position[:, 1] / position[:, 2] * environment.fy + environment.cy
        in_picture = (position[:, 2] > 0) & (u >= 0) & (u < environment.width) & (v >= 0) & (v < environment.height)
        inside = np.flatnonzero(in_picture)
        seen = inside[self._is_seen(position[inside])]
        row, column = self._texels(u[seen], v[seen])
        pixels = self._of_texels(position[seen], row, column, np.zeros(len(seen), dtype=np.bool_))
        # A thin part may be seen from its other side than the ray hits
        same = np.einsum("ni,ni->n", pixels.normals, directions[seen]) < 0
        normals[seen[same]], albedo[seen[same]] = pixels.normals[same], pixels.albedo[same]
        points = BackdropPoints(position, normals, albedo, faces < 0)
        missed = np.flatnonzero(faces < 0)
        if self.bounding is None or len(missed) == 0:
            return points
        beyond = self.bounding.intersect(origins[missed], directions[missed])
        position[missed], normals[missed], albedo[missed] = beyond.position, beyond.normals, beyond.albedo
        outside = points.outside.copy()
        outside[missed] = beyond.outside
        return BackdropPoints(position, normals, albedo, outside)

    def _is_seen(self, position: Floats) -> NDArray[np.bool_]:
        """Whether the camera sees points of the surface, bool [n]."""
        assert self.surface is not None
        _, nearest = self.surface.hits(np.zeros_like(position), position)
        distance = np.linalg.norm(position, axis=1) - np.linalg.norm(nearest, axis=1)
        return np.asarray(~(distance > VISIBLE))


def true_room(
    file: Path, environment: Environment, albedo: Floats, exposure: float, bounding: BoundingSurface | None
) -> TrueRoom:
    """The room of a mesh in the room's world space, metres.

    Args:
        file: The mesh. Its materials and vertex or face colours (sRGB) are used; else the mean albedo of the room.
        environment: The room, with the colours that rays see.
        albedo: The room's albedo, linear, float64 [height, width, 3].
        exposure: Factor of the mesh's albedo: 1 / headroom of the lights.
        bounding: Surface for rays that miss the mesh.

    Raises:
        UserError: The mesh cannot be read.
    """
    mesh = load_mesh(file)
    rotation, eye = environment.camera_to_world[:, :3], environment.camera_to_world[:, 3]
    tracer = RayTracer(Triangles((mesh.vertices - eye) @ rotation, mesh.faces))
    colours = _face_colours(file, mesh)
    if colours is None:
        colours = np.broadcast_to(albedo.mean(axis=(0, 1)), (len(mesh.faces), 3))
    surface = TrueSurface(tracer, colours * exposure)
    return TrueRoom(environment, surface, environment.albedo, environment.normals, None, bounding, surface)


def _face_colours(file: Path, mesh: Mesh) -> Floats | None:
    """Linear colours of the faces, float64 [m, 3]: of the file's materials, else of its colours; None without any."""
    if mesh.materials != (PLAIN,):
        return np.array([material.albedo for material in mesh.materials])[mesh.face_materials]
    import trimesh

    loaded = trimesh.load(file, process=False, force="mesh")
    visual = getattr(loaded, "visual", None)
    if visual is None or visual.kind not in ("vertex", "face"):
        return None
    colours = np.asarray(visual.face_colors)
    if len(colours) != mesh.source_count:
        return None
    return linear_from_srgb(colours[mesh.source_faces, :3].astype(np.float64) / 255.0)
