"""The surfaces of a known room as triangles with colours, the same for maps and path tracer."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from colonnade.common.types import Floats
from colonnade.common.vectors import unit_vectors
from colonnade.environment.model import Environment, EnvironmentCamera
from colonnade.mesh.load import load_mesh
from colonnade.reference.embree import RayTracer, SurfacePoints, Triangles
from colonnade.scene.model import Transform
from colonnade.scene.object_pose import rotation_matrix
from numpy.typing import NDArray

from colonnade_lab.evaluation.light.rooms import PHOTO, KnownRoom, PointLight, Thing

#: Longest edge of a triangle of a room: its paint is given at its corners, in between it is linear.
_EDGE = 0.04
#: A point of an emitter can be seen if nothing lies before this part of the way to it.
_BEFORE = 0.999


@dataclass(frozen=True)
class RoomSurface:
    """The triangles of a room.

    Attributes:
        vertices, colours: World space, and linear albedo, float64 [n, 3] each.
        faces: int32 [m, 3].
    """

    vertices: Floats
    colours: Floats
    faces: NDArray[np.int32]

    @classmethod
    def of(cls, room: KnownRoom) -> RoomSurface:
        """The surface of a room."""
        from trimesh.remesh import subdivide_to_size

        found, colours, faces, count = [], [], [], 0
        for part in room.parts():
            vertices, triangles = subdivide_to_size(part.vertices, part.faces, _EDGE, max_iter=20)
            found.append(np.asarray(vertices))
            colours.append(part.paint(found[-1] - np.array(part.centre or (0.0, 0.0, 0.0))).clip(0.0, 1.0))
            faces.append(np.asarray(triangles) + count)
            count += len(vertices)
        return cls(np.concatenate(found), np.concatenate(colours), np.concatenate(faces).astype(np.int32))

    @cached_property
    def tracer(self) -> RayTracer:
        """Intersects rays with it."""
        return RayTracer(Triangles(self.vertices, self.faces))

    def hits(self, origins: Floats, directions: Floats) -> tuple[SurfacePoints, NDArray[np.int64]]:
        """The points that rays hit, float64 [n, 3] each, and their faces; a ray must not leave the room."""
        faces = self.tracer.first_hits(origins, directions)
        return self.tracer.surface_points(faces, origins, directions), faces

    def lights(self, room: KnownRoom) -> list[PointLight]:
        """The emitters of a room as point lights.

        Each is as bright at the objects' place, and has the middle and the area, of the part that the objects see of
        it, in the mean over their middles. A place counts once, whatever stands there in which frame.
        """
        place, found = np.array(room.place), []
        middles = np.unique([thing.middle for things in room.frames.values() for thing in things], axis=0)
        for emitter in room.emitters:
            position, intensity, radius = emitter.seen_from(place)
            points = emitter.points(place)
            is_seen = np.array(
                [
                    ~self.tracer.occluded(np.broadcast_to(middle, points.shape), (points - middle) * _BEFORE)
                    for middle in middles
                ]
            )
            seen = float(is_seen.mean())
            if seen > 0:
                weights = is_seen.mean(axis=0) / is_seen.mean(axis=0).sum()
                middle = position + weights @ points - points.mean(axis=0)
                found.append((middle, intensity * seen, radius * float(np.sqrt(seen))))
        return found

    def maps(self, name: str, camera: EnvironmentCamera, photo: NDArray[np.uint8]) -> Environment:
        """The maps of a camera, with its photo, uint8 [height, width, 3]."""
        width, height = PHOTO
        rotation, eye = camera.to_world[:, :3], camera.to_world[:, 3]
        directions = camera.directions(width, height).reshape(-1, 3) @ rotation.T
        points, faces = self.hits(np.broadcast_to(eye, directions.shape), directions)
        corners = self.tracer.corners[faces]
        normals = unit_vectors(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
        normals *= np.where(np.einsum("ni,ni->n", normals, directions) > 0, -1.0, 1.0)[:, None]
        albedo = np.einsum("nk,nki->ni", points.weights, self.colours[self.faces[faces]])
        shape = (height, width, 3)
        depth = points.t.reshape(height, width)
        return Environment(name, albedo.reshape(shape), (normals @ rotation).reshape(shape), depth, True, camera, photo)


def pose_of(thing: Thing) -> Transform:
    """The transform of an object's mesh that stands it at its foot."""
    mesh, rotate = load_mesh(thing.mesh), (thing.tilt, thing.turn, 0.0)
    scale = thing.size / mesh.extent.edge
    placed = mesh.vertices @ rotation_matrix(Transform(rotate)).T * scale
    low, high = placed.min(axis=0), placed.max(axis=0)
    x, y, z = np.array(thing.foot) - ((low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2)
    return Transform(rotate, float(scale), (float(x), float(y), float(z)))


@dataclass(frozen=True)
class ThingSurface:
    """The triangles of an object in world space.

    Attributes:
        vertices: Three for each face, float64 [3 m, 3].
        normals: At the corners, float64 [3 m, 3].
    """

    vertices: Floats
    normals: Floats

    @classmethod
    def of(cls, thing: Thing) -> ThingSurface:
        """The surface of an object at its place."""
        mesh, pose = load_mesh(thing.mesh), pose_of(thing)
        rotation = rotation_matrix(pose)
        vertices = mesh.vertices @ rotation.T * pose.scale + np.array(pose.translate)
        normals = mesh.corner_normals.reshape(-1, 3) @ rotation.T
        return cls(vertices[mesh.faces].reshape(-1, 3), normals)

    @property
    def faces(self) -> NDArray[np.int32]:
        """int32 [m, 3]."""
        return np.arange(len(self.vertices), dtype=np.int32).reshape(-1, 3)
